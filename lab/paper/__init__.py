"""The paper, reproduced and judged: `python -m lab paper`.

`cases` has the eleven cases, their starts and readings; `measures`, `motion` and `quantities` what is measured of a
scene; `equations` and `conditions` hold (1) to (37) against the motion; `observations` and `running_text` restate
what the paper says as parts that `compare` and `universal` check and `claims` turns into verdicts; `beyond`, `arms` and
`knife_edge` compute what the paper lacks; `figures`, `results`, `replay` and `page` show it, in the words of
`templates`; `study` runs everything.
"""
