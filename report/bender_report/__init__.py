"""One look for every page and picture.

| module | holds |
|---|---|
| `page`, `templates/` | the page maker: base template, common style, pages of sections |
| `palette` | the colours, light and dark |
| `chart` | charts as SVG that follow the page |
| `picture_style` | pictures as PNG |
| `record_overlay` | the picture of a simulation over a record |
| `drawing` | whether matplotlib is there, and the sentence where it is not |
| `number`, `wording` | numbers, units and lists in words |
"""
