"""An item as LaTeX (booktabs) and as CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

from reports.papers.terminal import printed
from reports.papers.verdicts import Cell, Judged, worded

_ESCAPES = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "−": "$-$", "–": "--", "→": r"$\rightarrow$", "×": r"$\times$", "∞": r"$\infty$", "²": "$^2$", "·": r"$\cdot$",
    "\N{NO-BREAK SPACE}": "~", "µ": r"\textmu{}", "°": r"$^\circ$", "≤": r"$\leq$", "≥": r"$\geq$",
}  # fmt: skip
_POWER = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]{2,}|⁻[⁰¹²³⁴⁵⁶⁷⁸⁹]")
_PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def escaped(text: str) -> str:
    r"""Return text as LaTeX prints it.

    Examples
    --------
    >>> escaped("50 % of x_1 & −1.5×10⁻⁷")
    '50 \\% of x\\_1 \\& $-$1.5$\\times$10$^{-7}$'
    """
    out, end = [], 0
    for power in _POWER.finditer(text):
        out += [_characters(text[end : power.start()]), f"$^{{{power[0].translate(_PLAIN)}}}$"]
        end = power.end()
    return "".join(out) + _characters(text[end:])


def _characters(text: str) -> str:
    return "".join(_ESCAPES.get(character, character) for character in text)


def latex(judged: Judged) -> str:
    """Return an item's comparisons, and beneath them the study's table: two tables of booktabs."""
    item = judged.item
    lines = [f"% {item.item}: {item.title}. Needs \\usepackage{{booktabs}}."]
    lines += [f"% {part.what}: {source}" for part in judged.parts for source in part.sources]
    compared = [
        (
            part.what,
            printed(part),
            worded(part.ours),
            part.verdict or "shown",
            ". ".join(filter(None, (part.rule, part.words))),
        )
        for part in judged.parts
    ]
    caption = f"{item.item}. {item.title}: {judged.verdict}"
    headings = ("", "printed", "ours", "verdict", "how")
    lines += _table(headings, compared, "lrrlp{6cm}", caption, f"tab:{item.file.parent.name}-{item.slug}")
    if judged.found:
        study = judged.found.study
        rows = [tuple(map(worded, row)) for row in study.rows]
        numbers = [all(not isinstance(row[i], str | bool) for row in study.rows) for i in range(len(study.columns))]
        shape = "".join("r" if number else "l" for number in numbers)
        named = f"{study.title} (study {study.name}, run {judged.found.run.id}, commit {judged.found.run.commit})"
        lines += ["", *_table(study.columns, rows, shape, named, f"tab:{item.file.parent.name}-{item.slug}-study")]
    return "\n".join(lines) + "\n"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]], shape: str, caption: str, label: str) -> list[str]:
    def row(entries: Sequence[str]) -> str:
        return "    " + " & ".join(map(escaped, entries)) + r" \\"

    return [
        r"\begin{table}", r"  \centering", rf"  \caption{{{escaped(caption)}}}", rf"  \label{{{label}}}",
        rf"  \begin{{tabular}}{{{shape}}}", r"    \toprule", row(headings), r"    \midrule", *map(row, rows),
        r"    \bottomrule", r"  \end{tabular}", r"\end{table}",
    ]  # fmt: skip


def comparisons(judged: Judged) -> str:
    """Return an item's comparisons as CSV, each number with where it stands."""
    headings = ("item", "what", "kind", "printed", "ours", "rule", "verdict", "words")
    rows: list[tuple[Cell, ...]] = []
    for part in judged.parts:
        at = "; ".join(map(str, part.sources))
        verdict = part.verdict or "shown"
        rows.append(
            (judged.item.item, part.what, part.kind, part.printed, part.ours, part.rule, verdict, part.words, at)
        )
    return _csv((*headings, "from"), rows)


def table(judged: Judged) -> str:
    """Return the whole table of an item's study as CSV, with run and commit in every row."""
    assert judged.found is not None
    study, run = judged.found.study, judged.found.run
    rows = [(*row, run.id, study.name, i, run.commit) for i, row in enumerate(study.rows, 1)]
    return _csv((*study.columns, "run", "study", "row", "commit"), rows)


def _csv(headings: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(rows)
    return out.getvalue()
