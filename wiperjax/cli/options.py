"""What the commands share: options, and checks of paths before any work."""

import contextlib
import functools
import math
import shlex
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ..vocabulary.pictures import DOTS, DPI, DPI_MOVING

MAP_SUFFIXES = (".h5", ".hdf5", ".nc")
SOUND_SUFFIXES = (".wav",)
INTERRUPTED = 130  # what a shell reports for a command ended by Ctrl-C


class Said(int):
    """An exit status whose reason has been said."""


def interrupted(stopped: KeyboardInterrupt, kept: Path, words: Sequence[str]) -> typer.Exit:
    """Says that a computation was stopped and, if anything is `kept`, by what `words` it goes on;
    returns what is to be raised.
    """
    said = str(stopped) or "interrupted"
    if not str(stopped) and kept.exists():  # stopped beside the blocks, which say so themselves
        said += f": what is finished is kept in {kept}; go on with\n  {shlex.join(words)}"
    print(f"wiperjax: {said}", file=sys.stderr)
    return typer.Exit(Said(INTERRUPTED))


Model = Annotated[
    str | None,
    typer.Option(
        metavar="block|bar|lip",
        help="Model instead of the file's: a block on a belt, the lip held on the glass, or all.",
        show_default="the file's, or lip",
    ),
]
SweptModel = Annotated[
    str | None,
    typer.Option(
        metavar="MODEL",
        help="Instead of the file's: block (on a belt), bar (the lip held on the glass), lip (all) "
        "or auto: the poorest that says the same as the lip of some cells.",
        show_default="the file's, or lip",
    ),
]


def _finite(number: float | None) -> float | None:
    """Has a time that is none refused by the name of its option."""
    if number is not None and not math.isfinite(number):
        raise typer.BadParameter(f"must be a finite number, was {number}")
    return number


Begin = Annotated[
    float | None,
    typer.Option("--from", metavar="S", callback=_finite, help="Run: begin here (s)."),
]
End = Annotated[
    float | None, typer.Option("--to", metavar="S", callback=_finite, help="Run: end here (s).")
]
Component = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="Run: which coordinate; of a lip 0 along the glass, 1 normal to it.",
        show_default="that of the contact",
    ),
]
Curves = Annotated[
    Path | None,
    typer.Option(metavar="BRANCH.h5", help="Map: draw these curves over it ('follow --second')."),
]
Dpi = Annotated[
    int | None,
    typer.Option(
        help=f"Dots per inch, {DOTS[0]} to {DOTS[1]}.",
        show_default=f"{DPI}; of an animation {DPI_MOVING}",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace existing output.")]


def check_source(path: Path) -> None:
    """Raises OSError or StoreError if `path` is neither a folder nor a file that can be read."""
    from ..store.whole import check_exists

    if path.is_dir():
        return
    check_exists(path)
    with path.open("rb"):
        pass


def read(path: Path, wanted: Collection[str], use: str) -> tuple[Any, str]:
    """The dataset of a file, in memory, and its kind. Raises StoreError for a file that is damaged,
    or not of a kind `wanted`, which alone can be `use`d.
    """
    from ..datasets.kinds import check_kind
    from ..store.whole import open_map, sound

    sound(path)
    with open_map(path) as dataset:
        kind = check_kind(dataset, wanted, use, path)
        dataset.load()
    print_stated(dataset)
    print_doubts(dataset)
    return dataset, kind


def print_stated(dataset: Any) -> None:
    """A note if what a file states of itself, parameters or borders of the classes, cannot be what
    it was made with; nothing else.
    """
    from ..datasets.stated import wrong_attribute

    if why := wrong_attribute(dataset):
        print(f"note: its attribute {why}: another program changed it", file=sys.stderr)


def print_doubts(dataset: Any) -> None:
    """A note of each thing that a file holds and cannot be, or can be told with gaps only; nothing
    else.
    """
    from ..datasets.kinds import doubts

    for doubt in doubts(dataset):
        print(f"note: {doubt}", file=sys.stderr)


def of_file(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command of an HDF5 `file`, in which it may miss what another program took from it: that is
    one line. Of a file as we wrote it, it is a bug, whose traceback is wanted.
    """

    @functools.wraps(command)
    def told(file: Path, **options: Any) -> None:
        try:
            command(file=file, **options)
        except OSError as error:
            if error.errno is not None:
                raise
            from ..machine.files import StoreError  # HDF5's own words, without the file

            raise StoreError(f"{file}: cannot be read: {str(error).splitlines()[0]}") from error
        except (LookupError, TypeError, AttributeError, ArithmeticError) as error:
            import h5py

            from ..machine.files import StoreError
            from ..store.whole import damages

            if not h5py.is_hdf5(file) or damages(file) is not None:
                raise
            words = str(error.args[0] if error.args else error).splitlines()[0]
            changed = "another program changed it since wiperjax wrote it, if it did"
            raise StoreError(f"{file}: cannot be told as it is: {words} ({changed})") from error

    return told


@contextlib.contextmanager
def told_of(file: Path) -> Iterator[None]:
    """Has what is wrong name the file."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def beside(path: Path, ending: str) -> Path:
    """The name of what is made of `path` where none is given: its own with another ending. Raises
    ValueError for a folder that is named by dots alone.
    """
    if path.name in ("", ".."):
        raise ValueError(f"-o must be given: {path} has no name to call a file after")
    return path.with_name(Path(path.name.removesuffix(".parts")).stem + ending)


def check_target(path: Path, suffixes: Sequence[str], force: bool, *sources: Path) -> None:
    """Raises ValueError or StoreError if `path` is no place for a new file made from `sources`."""
    if path.name.lower() in ("", *suffixes):  # "", "." or an ending alone
        raise ValueError(f"the output must name a file that ends in {' or '.join(suffixes)}")
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"{path}: must end in {' or '.join(suffixes)}")
    from ..machine.files import check_output

    for source in sources:
        check_output(path, force, source)


def cuts(texts: Sequence[str] | None, option: str = "--at") -> dict[str, float | str] | None:
    """`AXIS=VALUE` of an option as a mapping; a start may have a name. Raises ValueError, which
    names the option, for any other form, and for an axis that is named twice.
    """
    cuts: dict[str, float | str] = {}
    for text in texts or ():
        name, _, value = (part.strip() for part in text.partition("="))
        check_once(option, name, cuts)
        try:
            cuts[name] = float(value)
        except ValueError:
            if name == "start" and value:
                cuts["start"] = value
                continue
            raise ValueError(
                f"{option} must be AXIS=NUMBER, such as normal_load=15, was {text}"
            ) from None
    return cuts or None


def check_once(option: str, name: str, known: Collection[str]) -> None:
    """Raises ValueError for an axis that an option has named before: which of the two is meant?"""
    if name in known:
        raise ValueError(f"{option} must name each axis once, but named {name} twice")


def command_line() -> str:
    """The command that this process was started by, for the file that it makes: in UTF-8, which
    names of files need not be."""
    line = shlex.join(["wiperjax", *sys.argv[1:]])
    return line.encode(errors="backslashreplace").decode()


def configure(cores: int | None, **options: bool) -> None:
    """Settings of XLA, which must precede the first `import jax`."""
    from ..machine.jax_settings import configure

    configure(cores=cores, **options)
