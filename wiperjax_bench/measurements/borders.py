"""`wiperjax bench borders`: how far borders are known for so many simulations, four ways.

The truth is the class of random points of the reference blade's plane, each simulated. A refined
map is asked at them with what it was given at each of its levels. A full grid, an octree and
`adaptive.LearnerND` are asked too; they take their simulations from the finest refined map, whose
own errors are in the chart: a full grid of its resolution would be millions.
"""

import importlib.util
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from wiperjax.maps.block import engine, evaluate_block
from wiperjax.maps.driver import sweep
from wiperjax.maps.refine.cubes import Cubes
from wiperjax.maps.refine.driver import refine
from wiperjax.maps.refine.grid import Grid
from wiperjax.maps.refine.points import ROOM, Points
from wiperjax.maps.refine.replay import replay
from wiperjax.maps.refine.search import Search
from wiperjax.specs.load import parse_sweep
from wiperjax.specs.refine import Refine
from wiperjax.vocabulary.codes import SETTLED

from ..harness import measure

PLANE = {
    "axes": {
        "attack_angle": {"start": -40, "stop": 40, "num": 51},
        "belt_speed": {"start": 0.02, "stop": 1.0, "num": 51, "spacing": "geometric"},
    },
    "blade": {"normal_load": 15},
    "run": {"transient": 0.4, "window": 0.4},
}
QUICK = {
    "axes": {
        "attack_angle": {"start": -20, "stop": 20, "num": 5},
        "belt_speed": {"start": 0.2, "stop": 0.8, "num": 5},
    },
    "blade": {"normal_load": 15},
    "run": {"transient": 0.1, "window": 0.1},
}
LENGTHEN = Refine.model_fields["lengthen"].default  # as in a refinement
FINER = 4  # levels beyond the finest, for points that no method has
ADAPTIVE = (100, 200, 400, 800, 1600)


def run(output: Path, *, quick: bool = False, count: int = 2000, seed: int = 7, say=print):
    """Return the dataset: simulations and share of wrong classes of each method."""
    given, levels = (QUICK, 2) if quick else (PLANE, 5)
    spec, count = parse_sweep(given, "bench borders"), 64 if quick else count
    folder = output.with_name(output.name + ".maps")
    folder.mkdir(exist_ok=True)
    file = folder / "map-0.h5"
    sweep(spec, file, resume=True, progress=False).close()
    grid = Grid(spec.axes, levels + FINER)
    index, truth = direct(spec, grid, count, seed)
    say(f"{count} random points simulated")
    rows: list[dict[str, Any]] = []

    def add(method, step, simulations, code, **more):
        wrong = code != truth
        rows.append({"method": method, "step": step, "simulations": simulations,
                     "wrong": float(wrong.mean())} | more)  # fmt: skip
        say(f"  {method}, step 1/{1 / step:.0f}: {simulations} simulations, {wrong.mean():.3%}")

    for level in range(1, levels + 1):
        previous, file = file, folder / f"map-{level}.h5"
        if not file.exists():
            shutil.copy(previous, file)
        found = refine(file, levels=level, progress=False)
        search, _ = replay(file)
        places = grid.places(index) / 2 ** (grid.levels - level)
        code, depth = search.answer(places)
        off, beyond = depth[code != truth], int((search.sure(places) & (code != truth)).sum())
        total = int(found.attrs["simulations"] + found.attrs["map_cells"])
        far = float(off[np.isfinite(off)].max(initial=0.0))
        step = 1 / float(search.grid.shape.max() - 1)
        unseen = int(np.isinf(off).sum())
        add("refined map", step, total, code, far=far, beyond=beyond, unseen=unseen)
    places = grid.places(index) / 2**FINER
    for row in (*full_grids(search, places), *octrees(search, places)):
        add(*row)
    if importlib.util.find_spec("adaptive") is not None:
        for row in learner(search, places, ADAPTIVE[:1] if quick else ADAPTIVE):
            add(*row)
    names = ("method", "step", "simulations", "wrong", "far", "beyond", "unseen")
    data = {name: ("row", [row.get(name, np.nan) for row in rows]) for name in names}
    attrs = measure.attributes("borders known for so many simulations")
    dataset = xr.Dataset(data, attrs=attrs | {"points": count})
    dataset.to_netcdf(output, engine="h5netcdf")
    return dataset


def direct(spec: Any, grid: Grid, count: int, seed: int):
    """Numbers of random points of a grid, and their classes, each simulated; what is not settled
    with the longer window.
    """
    rng = np.random.default_rng(seed)
    index = np.unique(grid.flat(rng.integers(0, grid.shape, (count, grid.dim))))

    def columns(some, factor):
        points = Points(spec, grid, some, factor)
        parts = [
            evaluate_block(points, np.arange(k, min(k + ROOM, len(some))), engine()[0])[0]
            for k in range(0, len(some), ROOM)
        ]
        return {name: np.concatenate([p[name] for p in parts]) for name in ("label", "settled")}

    found = columns(index, 1)
    code = found["label"].astype(int)
    again = np.flatnonzero(found["settled"] == SETTLED["no"])
    if len(again):
        code[again] = columns(index[again], LENGTHEN)["label"]
    return index, code


def full_grids(search: Search, places: np.ndarray):
    """(name, step, simulations, classes) of full grids: the class of the nearest node."""
    cells = search.grid.shape - 1
    for power in range(1, search.grid.levels + 1):
        width = 2 ** (search.grid.levels - power)
        count = cells // width
        near = np.clip(np.rint(places / width), 0, count) * width
        code = search.answer(near)[0]
        yield "full grid", 1 / float(count.max()), int(np.prod(count + 1)), code


def octrees(search: Search, places: np.ndarray):
    """The same of cells with unlike corners halved again and again."""
    grid = search.grid
    cubes = Cubes.of_map(grid, np.zeros(grid.dim, int), grid.coarse - 1)
    points = np.unique(cubes.corners())
    for level in range(1, grid.levels + 1):
        corners = cubes.corners()
        code = search.answer(grid.places(corners).reshape(-1, grid.dim))[0].reshape(corners.shape)
        mixed = (code != code[:, :1]).any(axis=1) & (cubes.size == grid.width >> (level - 1))
        points = np.union1d(points, cubes.corners(mixed, 2))
        cubes = cubes.split(mixed)
        home = cubes.locate(np.floor(places).astype(np.int64))
        size = cubes.size[home, None]
        near = cubes.origin[home] + np.rint((places - cubes.origin[home]) / size) * size
        step = 1 / float((grid.coarse.max() - 1) * 2**level)
        yield "octree", step, len(points), search.answer(near)[0]


def learner(search: Search, places: np.ndarray, counts: tuple[int, ...]):
    """The same of `adaptive.LearnerND` on the class as a number, asked for the nearest point."""
    import adaptive  # pyright: ignore[reportMissingImports]
    from scipy.spatial import KDTree

    size = (search.grid.shape - 1).astype(float)

    def code(point):
        return float(search.answer(np.array([point]) * size)[0][0])

    found = adaptive.LearnerND(code, bounds=[(0.0, 1.0)] * search.grid.dim)
    for count in counts:
        adaptive.runner.simple(found, goal=lambda one, count=count: one.npoints >= count)
        points = np.array(list(found.data))
        values = np.array(list(found.data.values()))
        nearest = KDTree(points).query(places / size)[1]
        yield "adaptive", 1 / np.sqrt(count), found.npoints, values[nearest].astype(int)
