"""How the page looks: one style sheet, and what all figures share."""

from typing import Any

SHEET = """
:host { font-family: system-ui, 'DejaVu Sans', sans-serif; font-size: 13px; color: #1b1f24; }
h1 { font-size: 19px; margin: 0 0 2px 0; } h2 { font-size: 14px; margin: 0; color: #57606a; }
p { margin: 3px 0; } .note, .where { color: #57606a; } .fault { color: #9a3412; font-weight: 600; }
.noise { font-size: 19px; } .chip { display: inline-block; width: 15px; height: 15px;
  border: 1px solid #444; border-radius: 3px; margin-right: 7px; vertical-align: -1px; }
table.numbers { border-collapse: collapse; width: 316px; font-variant-numeric: tabular-nums; }
table.numbers th { font-weight: 400; text-align: left; color: #57606a; padding: 1px 6px 1px 0; }
table.numbers td { text-align: right; padding: 1px 6px; white-space: nowrap; }
table.numbers td.unit { color: #57606a; text-align: left; } td.here { font-weight: 600; }
table.numbers th[scope=col] { text-align: right; }
table.numbers tr + tr { border-top: 1px solid #eaeef2; }
.keys { display: flex; flex-wrap: wrap; gap: 2px 14px; } .key { white-space: nowrap; }
.key i { display: inline-block; width: 14px; height: 14px; border: 1px solid #555;
  margin-right: 5px; vertical-align: -2px; }
.key i.line { height: 0; border: 0; border-top: 3px solid #000; vertical-align: 3px; }
.bar { position: relative; height: 36px; width: 480px; margin: 2px 26px 0 8px; }
.bar .shades { height: 14px; border: 1px solid #888; }
.bar .tick { position: absolute; top: 17px; transform: translateX(-50%); font-size: 12px; }
.progress { width: 320px; height: 10px; border: 1px solid #8c959f; border-radius: 5px;
  overflow: hidden; margin-top: 8px; } .progress div { height: 100%; background: #0072B2; }
label { white-space: normal; } audio { height: 34px; width: 316px; }
textarea { font-family: ui-monospace, 'DejaVu Sans Mono', monospace; font-size: 12px; }
.readout { min-height: 34px; font-variant-numeric: tabular-nums; }
kbd { border: 1px solid #bbb; border-radius: 3px; padding: 0 4px; background: #f6f8fa; }
:focus-visible { outline: 2px solid #0072B2; outline-offset: 1px; }
"""

PAGE = """
{% block postamble %}
<style>
  html { background: #ffffff; } body { margin: 10px 14px; }
</style>
{% endblock %}
"""


def titled() -> dict[str, Any]:
    """What all figures share."""
    return {"min_border": 4, "outline_line_color": "#8c959f"}
