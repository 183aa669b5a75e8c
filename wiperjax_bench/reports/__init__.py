"""What a person sees of a measurement, made from its data alone.

Each measurement has a text (``_text``) and a picture (``_plot``), or both in one (``_page``);
`words` is what they share. `rule` makes the table behind `sweep --target-error` from a chart.
"""
