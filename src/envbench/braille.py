"""Line drawings on a terminal: braille characters, 2 x 4 dots each."""

from __future__ import annotations

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""The bit of each dot in Unicode's braille block, by row and column within a character."""


class Canvas:
    """`width` x `height` dots, all unset; row 0 on top. ``str`` gives the lines of text.

    Examples
    --------
    >>> canvas = Canvas(4, 4)
    >>> canvas.line((0, 0), (3, 3))
    >>> str(canvas)
    '⠑⢄'
    """

    def __init__(self, width: int, height: int) -> None:
        self._cells = [[0] * -(-width // 2) for _ in range(-(-height // 4))]
        self._size = width, height

    def dot(self, x: float, y: float) -> None:
        """Set the dot nearest to a place, if it lies on the canvas."""
        column, row = round(x), round(y)
        if 0 <= column < self._size[0] and 0 <= row < self._size[1]:
            self._cells[row // 4][column // 2] |= _DOTS[row % 4][column % 2]

    def line(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Set the dots between two places."""
        steps = max(1, round(max(abs(end[0] - start[0]), abs(end[1] - start[1]))))
        for i in range(steps + 1):
            t = i / steps
            self.dot(start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1]))

    def __str__(self) -> str:
        return "\n".join("".join(chr(0x2800 + cell) for cell in row) for row in self._cells)
