"""Workers of a scheduler that is there already, and what they refuse; no process is started."""

import contextlib
import importlib
import sys
import time
from typing import Any

import pytest
import stub_sweep as stub

from wiperjax.machine import provenance
from wiperjax.maps import cluster, worker
from wiperjax.specs.load import load_sweep

pytestmark = pytest.mark.filterwarnings("default")  # of dask and its sockets


@pytest.fixture(scope="module")
def scheduler():
    """Address of a scheduler with a worker, in threads of this process."""
    from distributed import LocalCluster

    there: dict[str, Any] = {"protocol": "tcp", "host": "127.0.0.1", "dashboard_address": None}
    found: Any = LocalCluster(n_workers=1, processes=False, **there)
    with found:
        yield found.scheduler_address


def test_workers_of_a_scheduler_make_the_same_map(tmp_path, scheduler):
    spec, path = stub.make_spec(), tmp_path / "map.h5"
    with cluster.connect(scheduler) as workers:
        stub.run(spec, path, workers=workers)
    stub.assert_same_map(path, spec)


def test_a_last_worker_that_leaves_after_its_block_is_no_error(tmp_path, scheduler, monkeypatch):
    with cluster.connect(scheduler) as workers:
        result, left = workers._result, []

        def leaving(attempt, what, *patience):
            """There is none for once, as soon as the first block is here."""
            found = result(attempt, what, *patience)
            if what.startswith("block "):
                left.append(what)
            return {} if what == "workers" and len(left) == 1 else found

        monkeypatch.setattr(workers, "_result", leaving)
        stub.run(stub.make_spec(), tmp_path / "map.h5", workers=workers)
    assert left
    stub.assert_same_map(tmp_path / "map.h5", stub.make_spec())


def test_times_of_a_cluster_are_of_its_workers(tmp_path, scheduler):
    def slow(spec, index, *look):
        time.sleep(0.1)
        return stub.evaluate(spec, index, *look)

    with cluster.connect(scheduler) as workers:
        begun = time.monotonic()
        ds = stub.run(stub.make_spec(), tmp_path / "map.h5", workers=workers, evaluate=slow)
        passed = time.monotonic() - begun
    took = {name: ds.attrs[f"{name}_time"] for name in provenance.PHASES}
    idle = took.pop("idle")
    assert passed > took["naming"] >= 8 * 0.1 > took["storing"] > 0  # waiting is not storing
    assert 0 < idle <= passed - took["naming"]


SYSTEM = """
import wiperjax
from wiperjax import parameter

class Block(wiperjax.AbstractBeltSystem):
    unilateral = False
    coordinates = ("x",)
    mass: float = parameter(1.0, "kg", above=0)
    friction: wiperjax.AbstractFriction = wiperjax.Coulomb(0.5)
    belt: wiperjax.AbstractBelt = wiperjax.SteadyBelt(0.2)

    def free_acceleration(self, t, q, v):
        return (-q[0] / self.mass,)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0
"""

LAW = """
import wiperjax
from wiperjax import parameter

class Law(wiperjax.AbstractFriction):
    static: float = parameter(0.5, low=0)

    def coefficient(self, speed):
        return self.static
"""

FILE = """
system = "{name}:Block"
parameters.friction = "{name}_law:Law"
axes.belt_speed = {{ values = [0.1, 0.2] }}
run = {{ transient = 1, window = 1 }}
"""


@pytest.fixture
def own(tmp_path, monkeypatch, request):
    """A sweep of a system and a law of one's own that lie beside it, and the name of its module."""
    name = f"own_{abs(hash(request.node.name)) % 10**9}"
    monkeypatch.setattr(sys, "path", [*sys.path])
    for ending, text in {".py": SYSTEM, "_law.py": LAW, ".toml": FILE}.items():
        (tmp_path / f"{name}{ending}").write_text(text.format(name=name))
    yield load_sweep(tmp_path / f"{name}.toml"), name
    for module in (name, f"{name}_law"):
        sys.modules.pop(module, None)


@contextlib.contextmanager
def elsewhere(name, monkeypatch):
    """As in another process, which has not imported the modules yet."""
    importlib.invalidate_caches()
    with monkeypatch.context() as patched:
        for module in (name, f"{name}_law"):
            patched.delitem(sys.modules, module)
        yield patched


def test_a_worker_finds_a_system_beside_its_file(own, tmp_path, monkeypatch):
    spec, name = own
    sent = worker.Own.of(spec)
    with elsewhere(name, monkeypatch) as patched:
        patched.setattr(sys, "path", [place for place in sys.path if place != str(tmp_path)])
        with pytest.raises(cluster.ClusterError, match=f"^a worker lacks .* '{name}' is not found"):
            worker.check_own(spec, sent._replace(folders=[]))
        worker.check_own(spec, sent)
        assert name in sys.modules


@pytest.mark.parametrize(("ending", "named"), [("", "Block"), ("_law", "Law")])
def test_a_worker_that_imported_an_older_module_is_refused(
    own, tmp_path, monkeypatch, ending, named
):
    """On a common disk: what lies there is what is meant, and not what the worker runs."""
    spec, name = own
    worker.check_own(spec, worker.Own.of(spec))
    path = tmp_path / f"{name}{ending}.py"
    path.write_text(path.read_text() + "\n# other physics\n")
    with elsewhere(name, monkeypatch):
        sent = worker.Own.of(spec)
        worker.check_own(spec, sent)  # one that is begun now
    refused = f"^a worker has another {name}{ending}:{named} than this process: .* anew$"
    with pytest.raises(cluster.ClusterError, match=refused):
        worker.check_own(spec, sent)


def test_a_worker_of_another_source_is_asked_before_every_block(own, tmp_path, monkeypatch):
    """Also one that comes while the others compute."""
    spec, name = own
    sent = worker.Own.of(spec)
    other = sent._replace(meaning=sent.meaning | {"system_source": "other"})
    with pytest.raises(cluster.ClusterError, match=f"a worker has another {name}:Block"):
        worker.compute(spec, other, 0, 2, stub.evaluate)
