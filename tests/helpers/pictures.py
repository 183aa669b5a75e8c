"""Figures as they are seen: what reaches beyond the page, and colours by eyes of several kinds."""

import matplotlib
import numpy as np


def legends(figure):
    return [*figure.legends, *(legend for part in figure.subfigs for legend in part.legends)]


def inside_the_page(figure):
    """Draws a figure; returns the texts of headings, axes and legends that reach beyond it."""
    figure.draw_without_rendering()
    width, height = figure.bbox.size
    axes = [*figure.axes, *(child for ax in figure.axes for child in ax.child_axes)]
    words = [
        *(text for ax in axes for text in (ax.xaxis.label, ax.yaxis.label, ax.title)),
        *(text for legend in legends(figure) for text in (*legend.get_texts(), legend.get_title())),
        *([figure._suptitle] if figure._suptitle else []),
    ]
    boxes = {text: text.get_window_extent() for text in words if text.get_text()}
    return [
        text.get_text()
        for text, box in boxes.items()
        if box.x0 < -1 or box.y0 < -1 or box.x1 > width + 1 or box.y1 > height + 1
    ]


# Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB.
SIGHT = {
    "usual": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def lab(colour, sight):
    """CIELAB of an sRGB colour as it is seen."""
    rgb = np.array(matplotlib.colors.to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
         [0.0193339, 0.1191920, 0.9503041]]
    )  # fmt: skip
    seen = np.clip(np.asarray(sight) @ linear, 0, 1)
    xyz = to_xyz @ seen / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])
