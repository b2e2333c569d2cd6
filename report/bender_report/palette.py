"""The colours of the report: each has a meaning, a light and a dark variant, and one name in the style sheet."""

TOKENS: dict[str, tuple[str, str]] = {
    "ink": ("#1d2530", "#e7eaee"),
    "muted": ("#626d7b", "#9aa5b3"),
    "rule": ("#e2e6eb", "#2d3541"),
    "page": ("#f7f8fa", "#11151b"),
    "card": ("#fefefe", "#191f28"),
    "measured": ("#454e5b", "#c3cad3"),
    "given": ("#8aa2bd", "#7690ad"),
    "without": ("#cf4a5c", "#e8707f"),
    "with": ("#0a7b8c", "#37b3c4"),
    "noise": ("#dde2e9", "#2b3340"),
    "held": ("#ecf2f9", "#1a222d"),
    "rising": ("#3867b0", "#7aa6ea"),
    "falling": ("#c98216", "#e8a94a"),
    "good": ("#2e7d4f", "#5cbd85"),
    "caution": ("#a86508", "#e0a040"),
}
"""Name -> (light, dark). Light ones are all different: pictures are drawn with them and then refer to the names."""


def light(name: str) -> str:
    """Return the light variant of a colour, that which pictures are drawn with."""
    return TOKENS[name][0]


def variables(dark: bool) -> str:
    """Return the colours as custom properties of a style sheet."""
    return "".join(f"--{name}:{pair[dark]};" for name, pair in TOKENS.items())
