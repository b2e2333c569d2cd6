"""The report page: one HTML file that needs nothing beside it."""

import base64
from collections.abc import Iterable, Sequence
from html import escape

from bender_identify.fitting.candidate import Candidate, Coefficient
from bender_identify.fitting.identifiability import WEAK
from bender_identify.identification import Identification
from bender_identify.report.facts import COLUMNS, table

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #22303c; background: #fff; margin: 2rem auto; max-width: 70rem;
  padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; border-bottom: 1px solid #d8dfe5; }
code, .equation { font-family: ui-monospace, "DejaVu Sans Mono", monospace; }
.equation { background: #f3f6f8; padding: .8rem 1rem; border-left: 4px solid #d1495b; overflow-x: auto; }
table { border-collapse: collapse; margin: .8rem 0; } .wide { overflow-x: auto; }
th, td { padding: .3rem .8rem; text-align: right; border-bottom: 1px solid #e4e9ed; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
tr.written td { font-weight: 600; background: #fbf3e4; }
td.weak { color: #b3261e; } li { margin: .3rem 0; } img { width: 100%; height: auto; }
.small { color: #566573; font-size: .9rem; }
"""


def page(outcome: Identification, picture: bytes, model_name: str) -> str:
    """Return the page, the picture of the loops inside it."""
    written, learned = outcome.written.candidate, outcome.rows[0].candidate
    names = ", ".join(x.name for x in outcome.experiments)
    body = [
        f"<h1>Hysteresis learned from {escape(names)}</h1>",
        f"<p>The model file <code>{escape(model_name)}</code> holds: <b>{escape(written.title)}</b>.</p>",
        f'<p class="equation">{_equation(written.equation)}</p>',
        *(_beside(learned) if learned is not written else ()),
        "<h2>What each model buys</h2>",
        _models(outcome),
        f'<p class="small">Every error is that of the re-simulated displacement, over the rms of the readings about '
        f"their mean. Held out: {escape(outcome.held_out_by)}. Floor of the held-out error, from what differs from "
        f"cycle to cycle or from the noise: {outcome.floor_percent:.3g} %. The written model is highlighted.</p>",
        f'<img alt="loops, time series and residuals" src="data:image/png;base64,{_encoded(picture)}">',
        "<h2>What to know before trusting it</h2>",
        _list(outcome.findings) if outcome.findings else "<p>Nothing was found that speaks against it.</p>",
        "<h2>Coefficients of the learned equation</h2>",
        _coefficients(learned.coefficients),
        '<p class="small">Intervals hold together with 95 % probability and allow for correlated residuals. Slack: how '
        "far the coefficient can move, the others making up for it, before the output moves by 1 % of its rms.</p>",
        *_others(outcome),
        "<h2>How it was found</h2>",
        _how(outcome),
    ]
    title = escape(f"Hysteresis of {names}")
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{_STYLE}</style>\n</head>\n<body>\n" + "\n".join(body) + "\n</body>\n</html>\n"
    )


def _beside(learned: Candidate) -> tuple[str, str]:
    return "<p>The learned equation beside it:</p>", f'<p class="equation">{_equation(learned.equation)}</p>'


def _equation(text: str) -> str:
    return escape(text.replace("; ", "\n")).replace("\n", "<br>").replace("-", "&minus;")


def _encoded(picture: bytes) -> str:
    return base64.b64encode(picture).decode("ascii")


def _models(outcome: Identification) -> str:
    rows = []
    for row, cells in zip(outcome.rows, table(outcome), strict=True):
        mark = ' class="written"' if row is outcome.written else ""
        rows.append(f"<tr{mark}>{''.join(f'<td>{_cell(cell)}</td>' for cell in cells)}</tr>")
    return _table(COLUMNS, rows)


def _coefficients(coefficients: Sequence[Coefficient]) -> str:
    rows = []
    for c in coefficients:
        interval = "-" if c.half_width is None else f"&plusmn; {c.half_width:.2g}"
        weak = c.slack is None or c.slack > WEAK
        slack = "any" if c.slack is None or c.slack > 100.0 else f"{100.0 * c.slack:.3g} %"
        rows.append(
            f"<tr><td><code>{escape(c.name)}</code></td><td>{_cell(c.value)}</td><td>{interval}</td>"
            f"<td>{escape(c.unit)}</td><td{' class=weak' if weak else ''}>{slack}</td></tr>"
        )
    return _table(("term", "coefficient", "interval", "unit", "slack"), rows)


def _others(outcome: Identification) -> Iterable[str]:
    written = outcome.written
    if written is outcome.rows[0]:
        return
    yield f"<h2>Coefficients of the written model, {escape(written.candidate.title)}</h2>"
    rows = [
        f"<tr><td><code>{escape(c.name)}</code></td><td>{_cell(c.value)}</td><td>{escape(c.unit)}</td></tr>"
        for c in written.candidate.coefficients
    ]
    yield _table(("part", "value", "unit"), rows)


def _how(outcome: Identification) -> str:
    learned, about = outcome.learned, outcome.identifiability
    lines = [
        f"library: {', '.join(learned.library)}",
        f"regression: {learned.regression.form} form, {len(learned.regression.rates)} rows",
        f"zero of the reading in the written model: {outcome.written.candidate.fit.offset_um:.4g} um",
        f"condition number of the library on this input: {about.condition_library:.3g}; of the output's derivatives to "
        f"the coefficients: {about.condition_output:.3g}",
        f"{len(learned.trials)} sets of terms were simulated over the whole records and compared by the Bayesian "
        "information criterion",
    ]
    if learned.ensemble is not None:
        shares = zip(learned.regression.terms, learned.ensemble.inclusion, strict=True)
        lines.append("share of the resamples that keep a term: " + ", ".join(f"{t} {x:.2f}" for t, x in shares))
    known = {k: v for k, v in outcome.unseen.rivals.items() if v is not None}
    if known:
        listed = ", ".join(f"{name} {value:.2g} %" for name, value in known.items())
        lines.append(f"distance from the written model on two tones that were not recorded: {listed}")
    if outcome.unseen.coefficients is not None:
        lines.append(
            f"spread on these two tones from the uncertainty of the learned coefficients: "
            f"{outcome.unseen.coefficients:.2g} %"
        )
    return _list(lines)


def _list(lines: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>"


def _table(columns: Sequence[str], rows: Iterable[str]) -> str:
    heads = "".join(f"<th>{escape(name)}</th>" for name in columns)
    return f'<div class="wide"><table><thead><tr>{heads}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _cell(value: str | int | float | None) -> str:
    if value is None:
        return "-"
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return escape(text).replace("-", "&minus;") if isinstance(value, float) else escape(text)
