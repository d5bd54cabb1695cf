"""Run the points of a study on this machine: some at a time, resumed, never twice."""

import os
import signal
import subprocess
import sys
import time
from collections import deque
from multiprocessing.connection import wait

from talus.faults import FaultError
from talus.files import write_text_file
from talus.study.definition import Study
from talus.study.folders import Store, lock_file

PATIENCE = 5.0  # between the request to end and the end by force [s]
LATE = 124  # exit code of a point that ran past its limit, as of timeout(1)
PAUSE = 0.5  # between looks at processes that an earlier driver left [s]


class Running:
    """A point that this driver has started."""

    def __init__(self, number: int, script: object, lock: int):
        """Start it in a group of its own; its processes inherit the lock."""
        self.number, self.start = number, time.monotonic()
        try:
            self.process = subprocess.Popen(["/bin/sh", str(script)], pass_fds=(lock,),
                                            start_new_session=True)  # fmt: skip
        finally:
            os.close(lock)
        self.handle = os.pidfd_open(self.process.pid)

    def kill(self) -> None:
        """End all its processes."""
        for sign in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(self.process.pid, sign)
                self.process.wait(PATIENCE)
            except (subprocess.TimeoutExpired, ProcessLookupError):
                continue
        self.process.wait()


class Progress:
    """A line of progress with the time left; in a file a line every tenth."""

    def __init__(self, total: int, cores: int):
        """Begin to count."""
        self.total, self.cores, self.shown = total, cores, -1
        self.terminal = sys.stderr.isatty()

    def show(self, done: int, failed: int, seconds: float) -> None:
        """Show it; `seconds` is the mean time of a point."""
        tenth = done if self.terminal else 10 * done // max(self.total, 1)
        if tenth == self.shown:
            return
        self.shown = tenth
        left = (self.total - done) * seconds / self.cores
        bad = f", {failed} failed" if failed else ""
        text = f"{done} of {self.total} points{bad}, {seconds:.3g} s a point, {span(left)} left"
        print(f"\r{text:78s}" if self.terminal else text, end="" if self.terminal else "\n",
              file=sys.stderr, flush=True)  # fmt: skip


def span(seconds: float) -> str:
    """Return a time in the unit that suits it."""
    for size, unit in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"


class Runner:
    """Keep `cores / threads` points at work until none is left."""

    def __init__(self, study: Study, store: Store):
        """Find out what is left."""
        self.study, self.store = study, store
        ends = {n: store.end_of(n) for n in store.numbers()}
        self.pending = deque(n for n, end in ends.items() if end is None)
        self.running: dict[int, Running] = {}
        self.left_over: set[int] = set()
        self.done = [end for end in ends.values() if end is not None]
        self.slots = max(1, study.run["cores"] // study.run["threads"])
        self.progress = Progress(len(ends), self.slots)

    def run(self) -> None:
        """Run all points; an interruption ends those at work, which are run anew later."""
        driver = lock_file(self.store.folder / "driver.lock")
        if driver is None:
            text = f"another 'talus study' is at work in {self.store.folder}"
            raise FaultError("E588", text, "talus study --status", exit_code=4)
        try:
            while self.pending or self.running or self.left_over:
                self.fill()
                self.look()
            self.show()
        finally:
            for one in self.running.values():
                one.kill()
            os.close(driver)
            if self.progress.terminal:
                print(file=sys.stderr)

    def fill(self) -> None:
        """Start points while there is room."""
        while self.pending and len(self.running) + len(self.left_over) < self.slots:
            number = self.pending.popleft()
            lock = self.store.lock(number)
            if lock is None:  # an earlier driver was killed, the point is still at work
                self.left_over.add(number)
            elif self.store.end_of(number):
                os.close(lock)
                self.finish(number)
            else:
                one = Running(number, self.store.prepare(self.study, number), lock)
                self.running[one.handle] = one

    def look(self) -> None:
        """Wait for an end, and take it in."""
        self.show()
        limit = self.study.run["limit"]
        pause = PAUSE if self.left_over or limit else None
        for handle in wait(list(self.running), pause) if self.running else [time.sleep(PAUSE)]:
            if handle is not None:
                self.end(self.running.pop(handle))
        late = [one for one in self.running.values()
                if limit and time.monotonic() - one.start > limit]  # fmt: skip
        for one in late:
            one.kill()
            self.end(self.running.pop(one.handle), LATE)
        for number in list(self.left_over):
            lock = self.store.lock(number)
            if lock is not None:
                os.close(lock)
                self.left_over.discard(number)
                self.pending.appendleft(number)

    def end(self, one: Running, code: int | None = None) -> None:
        """Take in the end of a point; one whose script was killed is kept as failed."""
        os.close(one.handle)
        code = one.process.wait() if code is None else code
        if self.store.end_of(one.number) is None:
            folder, now = self.store.point(one.number), time.time()
            begin = now - (time.monotonic() - one.start)
            say = (f"error: it ran past the limit of {self.study.run['limit']:g} s"
                   if code == LATE else f"error: its script ended with {code}")  # fmt: skip
            with (folder / "point.out").open("a") as out:
                out.write(f"{say}\n")
            write_text_file(folder / "exit", f'{{"exit_code": {code}, "begin": {begin}, '
                                             f'"end": {now}}}\n')  # fmt: skip
        self.finish(one.number)

    def finish(self, number: int) -> None:
        """Count a finished point."""
        self.done.append(self.store.end_of(number))

    def show(self) -> None:
        """Show the progress."""
        failed = sum(end["exit_code"] != 0 for end in self.done)
        mean = sum(end["end"] - end["begin"] for end in self.done) / max(len(self.done), 1)
        self.progress.show(len(self.done), failed, mean)
