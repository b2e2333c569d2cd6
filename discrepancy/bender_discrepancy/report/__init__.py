"""The report page of a diagnosis, its pictures, and the summary on the terminal.

| module | holds |
|---|---|
| `page`, `page.html.j2`, `page.css` | the page, on the base template of `bender_report` |
| `device_words` | words for devices that are no piezo bender |
| `effect_sections`, `lead_section`, `visible_section` | sections: an effect, an equation, what would have shown |
| `pictured_record` | one record as the pictures show it |
| `overlay_pictures`, `residual_pictures` | the pictures of the page |
| `effect_pictures` | what each effect does in a record |
| `chart_process` | the charts, half of them drawn by a process beside this one |
| `loop_and_creep` | a loop in a sentence, creep per decade |
| `loop_figures` | width, remanence and free stretch of a loop |
| `record_plot` | one record in axes of a notebook |
| `summary` | the lines on a terminal |
| `signature/` | what an effect leaves in the residual, pictured |
"""
