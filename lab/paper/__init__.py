"""The paper, reproduced and judged: `python -m lab paper`.

`cases` has the eleven cases, their starts and readings; `measures` and `motion` what is measured of a scene;
`equations` holds (1) to (37) against the motion; `observations` and `statements` restate what the paper says as parts
that `compare` and `universal` check and `claims` turns into verdicts; `beyond` and `arms` compute what the paper lacks;
`figures`, `results` and `page` show it, in the words of `templates`; `study` runs everything.
"""
