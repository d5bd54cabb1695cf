"""talus-dem with a bed of tiles, some of whose grains are awake, asked through the port."""

import os
import subprocess
import sys
from pathlib import Path

from talus.packing import Packing, write_h5
from talus.port import Message
from talus.programs import find_program

sys.path.insert(0, str(Path(__file__).parents[1] / "errors/base/port"))
from port import Asker  # noqa: E402


class Bed(Asker):
    """The program under way, and requests that must succeed."""

    def __init__(self, folder: Path, packing: Packing, deck: str) -> None:
        """Start it in a folder that has the tile, with these grains awake, and greet."""
        os.chdir(folder)
        write_h5(folder / "awake.h5", packing)
        (folder / "deck.nml").write_text(deck)
        super().__init__("meeting/side")
        command = [str(find_program("talus-dem")), "deck.nml", "--port=hdf5:meeting/side"]
        self.process = subprocess.Popen([*command, "--threads=1"], stdout=subprocess.DEVNULL)
        self.hello()
        self.ask("READY")

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request; the reply is no fault."""
        reply = super().ask(verb, t0, t1, **fields)
        assert reply.status == 0, reply.fields
        return reply

    def contacts(self) -> dict:
        """Return the force of each contact of two grains by its ids."""
        reply = self.ask("DESCRIBE", what="contacts").fields
        forces = zip(reply["ids"].tolist(), reply["force"], strict=True)
        return {tuple(ids): force for ids, force in forces if min(ids) > 0}
