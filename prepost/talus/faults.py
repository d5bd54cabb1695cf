"""Faults of users and machines: one clear line with code, value seen, place and hint."""


class FaultError(Exception):
    """A fault with code, message, place and hint; `exit_code` 1 for input, 4 for the system."""

    def __init__(
        self, code: str, message: str, hint: str = "", place: str = "", exit_code: int = 1
    ):
        """Keep the parts; `str()` gives the text for the user."""
        self.code, self.message, self.hint = code, message, hint
        self.place, self.exit_code = place, exit_code
        lines = [f"error {code}: {message}"]
        if place:
            lines.append(f"  at {place}")
        if hint:
            lines.append(f"  hint: {hint}")
        super().__init__("\n".join(lines))
