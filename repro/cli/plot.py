"""``repro plot FOLDER [QUANTITY] [--time TIME] --out FILE``: draw a run in a file.

Without a quantity and a file, list what can be drawn.
"""

from repro.cli.arguments import path
from repro.errors import OutputError, printable
from repro.runs.progress import say


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "plot", help="draw curves, a field, outlines or a film of a run",
        description="Without QUANTITY and --out, list what can be drawn. Without QUANTITY, draw "
        "the curves of a run over time. If QUANTITY is a column, draw its curve. If it is a field, "
        "such as acceptor, draw it at one time, or at all times as a film if FILE ends in .gif or "
        ".mp4. outlines are those of the aggregates at all rows, or at each --time. Drawing needs "
        "matplotlib.")
    command.add_argument("folder", metavar="FOLDER", type=path, help="folder of a run")
    command.add_argument("field", metavar="QUANTITY", nargs="?",
                         help="a field or a column, with or without its unit, or outlines")
    command.add_argument("--time", metavar="TIME", type=_time, action="append",
                         help='time of the field, such as "90 min"; a number without unit is in '
                         "hours (default: the last row); may be repeated for outlines")
    command.add_argument("--out", metavar="FILE", type=path,
                         help="file to write: .png, .pdf, .svg, or .gif or .mp4 for a film")
    command.add_argument("--log", action="store_const", const=True,
                         help="logarithmic scale (default: for a curve that spans two decades)")
    command.add_argument("--unit", metavar="UNIT", help="unit of the quantity, such as cm/s")
    command.add_argument("--title", metavar="TEXT", help="title of the picture")
    command.add_argument("--cmap", metavar="NAME", help="matplotlib's map of colours")
    command.add_argument("--image", metavar="FILE", type=path,
                         help="microscope image under outlines")
    command.add_argument("--um-per-pixel", metavar="UM", type=float, help="scale of the image")
    command.add_argument("--corner", metavar=("X", "Y"), type=float, nargs=2,
                         help="place of the image's lower left corner, um (default: the middle of "
                         "its lower edge is at 0 0, the middle of the lower wall)")
    command.set_defaults(call=call, refuse=command.error)


def _time(text: str) -> float | str:
    """Parse a number of hours; a text with a unit is left to the results."""
    try:
        return float(text)
    except ValueError:
        return text


def call(options) -> int:
    """List what can be drawn, or write the picture or the film."""
    from repro.runs.scripts import load_run

    results = load_run(options.folder)
    if options.out is None:
        if options.field:
            options.refuse("--out FILE is needed with QUANTITY")
        drawable = results.drawable()
        width = max(map(len, drawable), default=0)
        for name, words in drawable.items():
            say(printable(f"{name:{width}}  {words}"))
        return 0
    style = {name: getattr(options, name) for name in ("log", "unit", "title", "cmap")}
    try:
        if options.out.suffix in (".gif", ".mp4"):
            if options.field is None or options.time is not None:
                raise OutputError(f"{options.out}: a film needs QUANTITY and accepts no --time")
            results.animate(options.field, options.out, **style)
        else:
            from repro.results.files import output_path

            times = options.time
            with output_path(options.out) as beside:
                axes = results.plot(options.field, image=options.image, corner=options.corner,
                                    time=times[0] if times and len(times) == 1 else times,
                                    um_per_pixel=options.um_per_pixel, **style)
                figure = (axes[0] if isinstance(axes, list) else axes).figure
                figure.savefig(beside, dpi=150)
    except (ImportError, KeyError, TypeError, ValueError) as error:
        raise OutputError(str(error.args[0])) from error
    say(printable(f"{options.folder}: drawn in {options.out}"))
    return 0
