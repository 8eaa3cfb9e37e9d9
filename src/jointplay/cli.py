"""The command line: `jointplay scara`, `jointplay run`, and the commands of `commands/`."""

from __future__ import annotations

import argparse
import importlib
import re
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from jointplay.commands import MODULES, add_trust
from jointplay.errors import JointplayError
from jointplay.host import stopping, streams
from jointplay.host.stopping import INTERRUPTED

if TYPE_CHECKING:
    from jointplay.contact import NormalForceLaw
    from jointplay.loads.drive import JointFriction
    from jointplay.simulation.simulation import Simulation

BAD_INPUT = 2
STOPPED = 1

LAWS = (
    "lankarani-nikravesh",
    "hertz",
    "linear-spring",
    "kelvin-voigt",
    "anagnostopoulos",
    "hunt-crossley",
    "hunt-crossley-1975",
    "herbert-mcwhannell",
    "lee-wang",
    "gonthier",
    "zhang-sharf",
    "zhiying-qishao",
    "flores",
    "hu-guo",
    "carvalho-martins",
    "gharib-hurmuzlu",
    "johnson",
    "radzimovsky",
    "goldsmith",
    "dubowsky-freudenstein",
    "pereira",
    "esdu-78035",
    "liu",
)
LINEAR_LAWS = ("linear-spring", "kelvin-voigt", "anagnostopoulos")
SCENARIO_OPTIONS = {"file", "case", "jobs", "out", "no_figures", "certify", "quiet", "trust"}
"""Arguments of `run` that go with a scenario file."""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and takes -1e-4 and -1,0,0 for values, not for options."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        if action.option_strings and action.nargs is None and arg_strings == ["--"]:
            self.error(f"argument {'/'.join(action.option_strings)}: '--' is no value")
        return super()._get_values(action, arg_strings)  # type: ignore[misc]

    def error(self, message: str) -> NoReturn:
        message = " ".join(message.split())
        self.exit(BAD_INPUT, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="jointplay",
        description="Simulate robots whose joints have play: the journal flies, hits, slides and "
        "tilts in its bearing, and the tool pays for it.",
        epilog="Options are in SI units: m, s, kg, N, rad; scenario files take others too. "
        "Documentation: docs/.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    _add_scara(commands)
    _add_run(commands)
    for name in MODULES:
        importlib.import_module(f"jointplay.commands.{name}").add(commands)
    return parser


def _add_scara(commands: argparse._SubParsersAction[_Parser]) -> None:
    scara = commands.add_parser(
        "scara",
        help="run the study of the SCARA arm: three cases, figures, claims",
        description="Simulate the SCARA assembly robot of Wang et al. (2023) ideal, with 0.2 mm "
        "and with 0.5 mm of radial and axial clearance in joint B; give the headline figures with "
        "their numerical errors, and beside them those of explicit integration with a fixed step; "
        "draw Figures 9-15; test the paper's six claims on perturbed runs, with and without "
        "gravity, for both inertia variants.",
        epilog="DIR receives ideal.nc, case1_0.2mm.nc, case2_0.5mm.nc; fig09 ... fig15 as .png and "
        ".pdf; errors.md with the figures and their errors; claims.md and claims.csv; ensemble.csv "
        "with the numbers of each perturbed run.",
    )
    scara.add_argument("--out", metavar="DIR", required=True, help="folder for the results")
    scara.add_argument(
        "--runs",
        type=int,
        default=8,
        metavar="N",
        help="perturbed runs for each clearance and condition (default 8; 0: no claims)",
    )
    scara.add_argument(
        "--jobs", type=int, metavar="N", help="processes (default: one for each core)"
    )
    scara.add_argument("--quiet", action="store_true", help="show no progress")


def _add_run(commands: argparse._SubParsersAction[_Parser]) -> None:
    run = commands.add_parser(
        "run",
        usage="jointplay run FILE --out DIR [--case NAME] [--jobs N] [--certify]\n"
        "       jointplay run [options] --out DIR",
        help="simulate the cases of a scenario file, or one case of any robot",
        description="Simulate all cases of a scenario file, and draw figures that compare them. "
        "Or, without FILE, one robot with clearance in one revolute joint; without any options: "
        "the SCARA arm under gravity, 0.2 mm in joint B, 3 s.",
        epilog="DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load "
        "or any NetCDF reader), and the figures as .png and .pdf.",
    )
    group = run.add_argument_group("scenario")
    group.add_argument(
        "file",
        nargs="?",
        metavar="FILE",
        help="scenario (TOML): see jointplay init, jointplay check",
    )
    group.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="run only this case of FILE (repeatable)",
    )
    group.add_argument(
        "--jobs", type=int, metavar="N", help="processes for FILE (default: one for each core)"
    )
    add_trust(group)
    group = run.add_argument_group("robot")
    group.add_argument(
        "--urdf",
        metavar="FILE",
        help="robot, also example-robot-data:NAME (default: the SCARA arm)",
    )
    group.add_argument("--joint", metavar="NAME", help="revolute joint that has clearance")
    group.add_argument("--ideal", action="store_true", help="no clearance anywhere")
    group.add_argument("--tool", metavar="FRAME", help="frame to report (default: the last one)")
    group.add_argument(
        "--gravity",
        default="loaded",
        metavar="G",
        help="loaded (9.81 m/s^2 downwards, default), balanced (none), or gx,gy,gz [m/s^2]",
    )
    group.add_argument(
        "--allow-unphysical",
        action="append",
        default=[],
        metavar="LINK",
        help="accept this link's inertia although no rigid body has it (repeatable)",
    )
    group = run.add_argument_group("clearance joint")
    _number(group, "--radial", "radial clearance C_r [m] (default 2e-4)")
    _number(group, "--axial", "axial clearance C_a [m] (default 2e-4)")
    _number(group, "--bearing-radius", "R_i [m] (default 0.01)", 10e-3)
    _number(group, "--bearing-length", "L_i [m] (default 0.04)", 40e-3)
    _number(group, "--journal-radius", "R_j [m], instead of --radial")
    _number(group, "--journal-length", "L_j [m], instead of --axial")
    _number(group, "--young", "E of both [Pa] (default 207e9)", 207e9)
    _number(group, "--poisson", "nu of both (default 0.3)", 0.3)
    _number(group, "--stiffness", "k [N/m^1.5; N/m for linear laws] (default: from eq. 11)")
    _number(group, "--axial-stiffness", "k of the axial contacts (default: the radial one)")
    group = run.add_argument_group("laws")
    group.add_argument("--law", choices=LAWS, default=LAWS[0], help="normal force (default: first)")
    _number(group, "--restitution", "c_e, in (0, 1] (default 0.9)", 0.9)
    _number(group, "--damping", "b of kelvin-voigt [N s/m]")
    _number(group, "--impact-mass", "effective mass of an impact, for anagnostopoulos [kg]")
    group.add_argument(
        "--exponents",
        nargs=3,
        type=float,
        metavar=("N", "P", "Q"),
        help="n, p, q of hunt-crossley (default 1.5 1.5 1)",
    )
    _number(group, "--friction", "mu_d (default 0.1)", 0.1)
    group.add_argument(
        "--friction-speeds",
        nargs=2,
        type=float,
        default=(1e-4, 1e-3),
        metavar=("V0", "V1"),
        help="ramp of eq. 21 [m/s] (default 1e-4 1e-3)",
    )
    group = run.add_argument_group("motion and drive")
    group.add_argument(
        "--motion",
        metavar="CSV",
        help="waypoints, header time_s,<joint>,... (default: the paper's cycle)",
    )
    group.add_argument(
        "--interpolation",
        choices=("rest-to-rest", "spline"),
        default="rest-to-rest",
        help="stop at each waypoint (default), or pass through smoothly",
    )
    _number(group, "--bandwidth", "drives [rad/s] (default 100)", 100.0)
    _number(group, "--damping-ratio", "drives (default 1)", 1.0)
    group.add_argument(
        "--joint-friction",
        action="append",
        default=[],
        metavar="JOINT=C,V",
        help="Coulomb [N m or N] and viscous [N m s or N s/m] friction (repeatable; default: "
        "the URDF's)",
    )
    group.add_argument(
        "--seed", type=int, metavar="N", help="displace the journal at the start at random"
    )
    group.add_argument(
        "--start",
        choices=("rest", "centred"),
        help="where the journal begins: where it lies under load, or in the middle of its bearing "
        "(default: at rest where gravity acts)",
    )
    group.add_argument(
        "--settle",
        metavar="TIME",
        help="what is not judged at the start: seconds, or '2 turns' of a driven joint",
    )
    _number(group, "--judge-from", "when figures begin to be judged [s] (default: when settled)")
    group = run.add_argument_group("integration and output")
    _number(group, "--step", "time step [s] (default 1e-5)", 1e-5)
    _number(group, "--duration", "simulated time [s] (default: the motion's)")
    group.add_argument(
        "--integrator",
        choices=("multi-rate", "semi-implicit-euler", "rk4"),
        default="multi-rate",
        help="(default multi-rate)",
    )
    _number(
        group,
        "--macro-step",
        "interval at which multi-rate asks for the arm's inertia [s] (default: chosen by an error "
        "estimate)",
    )
    _number(
        group,
        "--tolerance",
        "lets multi-rate choose its micro steps: their error relative to what contacts and inertia "
        "move, such as 1e-3 (default: all as long as --step)",
    )
    group.add_argument(
        "--certify",
        action="store_true",
        help="run again more finely, and give the headline figures with their numerical errors; "
        "takes some ten times as long",
    )
    group.add_argument(
        "--record-every",
        type=int,
        default=10,
        metavar="N",
        help="steps between records; peaks in between are kept (default 10)",
    )
    group.add_argument("--out", metavar="DIR", required=True, help="folder for the results")
    group.add_argument("--no-figures", action="store_true", help="write no figures")
    group.add_argument("--quiet", action="store_true", help="show no progress")


def _number(
    group: argparse._ArgumentGroup, flag: str, text: str, default: float | None = None
) -> None:
    group.add_argument(flag, type=float, metavar="X", default=default, help=text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status.

    0: done. 1: the simulation stopped early (kept as far as it came). 2: wrong input.
    130: told to stop by Ctrl-C, SIGTERM or SIGHUP (likewise kept).
    """
    with streams.forgiving():
        try:
            parser = _parser()
            options = parser.parse_args(arguments)
            with stopping.listening():
                given = sys.argv[1:] if arguments is None else arguments
                status = _command(parser, options, given)
            sys.stdout.flush()  # what cannot be written must show here
            return status
        except BrokenPipeError:  # the reader, such as `head`, has seen enough
            streams.silence(sys.stdout)
            return STOPPED
        except OSError as error:  # standard output on a full disk
            streams.silence(sys.stdout)
            print(f"jointplay: error: cannot print: {error.strerror or error}", file=sys.stderr)
            return STOPPED
        except KeyboardInterrupt:  # once more, while ending
            return INTERRUPTED


def _command(
    parser: argparse.ArgumentParser, options: argparse.Namespace, arguments: Sequence[str]
) -> int:
    """Do what the options say; errors are one line."""
    if options.version:
        from importlib.metadata import version

        print(f"jointplay {version('jointplay')}")
        return 0
    if options.command is None:
        parser.print_help()
        return 0
    try:
        if hasattr(options, "handler"):
            return int(options.handler(options))
        if options.command == "scara":
            return _scara(options)
        return _run(options, arguments)
    except JointplayError as error:
        print(
            f"jointplay {options.command}: error: {' '.join(str(error).split())}", file=sys.stderr
        )
        return BAD_INPUT
    except ArithmeticError as error:
        reason = f"one is far too large or too small: {error}"
        print(
            f"jointplay {options.command}: error: these numbers cannot be computed with, {reason}",
            file=sys.stderr,
        )
        return BAD_INPUT
    except MemoryError:
        print(
            f"jointplay {options.command}: error: this machine's memory is too small for it; "
            "record less often, or simulate a shorter time",
            file=sys.stderr,
        )
        return BAD_INPUT
    except KeyboardInterrupt as error:
        print(f"\ninterrupted{_kept(str(error))}", file=sys.stderr)
        return INTERRUPTED


def _kept(lost: str) -> str:
    """What was given up, and what is there."""
    from jointplay.host import files

    parts = [lost] if lost else []
    if files.written:
        names = ", ".join(path.name for path in files.written)
        parts.append(f"in {files.written[0].parent} there is {names}")
    elif not lost:
        parts.append("nothing was written")
    return f"; {'; '.join(parts)}"


def _scara(options: argparse.Namespace) -> int:
    from jointplay import study

    started = time.perf_counter()
    progress = not options.quiet
    cases, rows, verdicts = study.run_study(options.out, options.runs, options.jobs, progress)
    for label, result in cases.items():
        print(f"\n{label}: {result.message}\n{result.audit}")
    print("\nFigures with their numerical errors, and the explicit method beside them:\n")
    print(study.errors_text(rows))
    if verdicts:
        print(f"\nThe paper's claims on {options.runs} runs each; numbers in claims.md:\n")
        print(study.summary(verdicts))
    print(f"\nresults in {options.out}, {time.perf_counter() - started:.0f} s")
    return 0


def _given(arguments: Sequence[str]) -> set[str]:
    """Names of those options of `run` that are on the command line, even at their defaults."""
    parser = _Parser(argument_default=argparse.SUPPRESS)
    commands = parser.add_subparsers()
    _add_run(commands)
    for action in commands.choices["run"]._actions:
        action.default = argparse.SUPPRESS
    return set(vars(parser.parse_args(arguments)))


def _run(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    given = _given(arguments)
    if options.file is not None:
        others = sorted(given - SCENARIO_OPTIONS)
        if others:
            raise JointplayError(
                f"--{others[0].replace('_', '-')} does not go with a scenario; "
                f"{options.file} says it all"
            )
        from jointplay.commands import run_scenario

        return run_scenario.run(options)
    for name in ("case", "jobs", "trust"):
        if name in given:
            raise JointplayError(f"--{name} needs a scenario: jointplay run FILE --{name} ...")
    return _run_options(options)


def _run_options(options: argparse.Namespace) -> int:
    from jointplay.host.files import claim
    from jointplay.kernel import Status
    from jointplay.scenario.keep import add_certificate, run_and_save

    simulation = _simulation(options)
    prepared = simulation.prepare()
    names = ["result.nc"]
    if not options.no_figures:
        from jointplay.plots import FIGURES

        names += [f"{name}.{kind}" for name in FIGURES for kind in ("png", "pdf")]
    out = claim(options.out, names)
    result = run_and_save(prepared, out / "result.nc", progress=not options.quiet)
    if options.certify:
        add_certificate(result, out / "result.nc", simulation, progress=not options.quiet)
    if not options.no_figures and len(result.time) > 1:
        from jointplay import plots

        label = "ideal" if options.ideal else next(iter(simulation.mechanism.clearance))
        plots.save({label: result}, out)
    print(f"{result.message}\n{result.judgement}")
    print(f"results in {options.out}")
    if result.status == Status.INTERRUPTED or stopping.told():
        return INTERRUPTED
    return 0 if result.status == Status.COMPLETED else STOPPED


def _simulation(options: argparse.Namespace) -> Simulation:
    from jointplay import study
    from jointplay.contact import Ambrosio
    from jointplay.joints import ClearanceJoint, Material
    from jointplay.loads.drive import ComputedTorque
    from jointplay.mechanism.mechanism import Mechanism
    from jointplay.mechanism.robots import resolve
    from jointplay.mechanism.urdf import shipped
    from jointplay.motion.reference import Motion
    from jointplay.simulation.simulation import Simulation

    path = resolve(options.urdf) if options.urdf else shipped("scara.urdf")
    ideal = Mechanism(
        path,
        gravity=_gravity(options.gravity),
        tool=options.tool,
        allow_unphysical=options.allow_unphysical,
    )
    if options.ideal:
        mechanism = ideal
    else:
        joint = options.joint or (study.JOINT if options.urdf is None else None)
        if joint is None:
            choices = ", ".join(ideal.description.revolute) or "none"
            raise JointplayError(f"--joint is missing; revolute joints of {path}: {choices}")
        material = Material(options.young, options.poisson)
        given = options.radial is not None or options.journal_radius is not None
        given_axial = options.axial is not None or options.journal_length is not None
        clearance = ClearanceJoint(
            bearing_radius=options.bearing_radius,
            bearing_length=options.bearing_length,
            radial_clearance=options.radial if given else 2e-4,
            axial_clearance=options.axial if given_axial else 2e-4,
            journal_radius=options.journal_radius,
            journal_length=options.journal_length,
            bearing_material=material,
            journal_material=material,
            restitution=options.restitution,
            normal=_law(options),
            friction=Ambrosio(options.friction, *options.friction_speeds),
            stiffness=None if options.law in LINEAR_LAWS else options.stiffness,
            axial_stiffness=options.axial_stiffness,
        )
        mechanism = ideal.with_clearance({joint: clearance})
    if options.motion is None and options.urdf is not None:
        header = ",".join(["time_s", *ideal.joints])
        raise JointplayError(f"--motion is missing; for {path} a CSV file with the header {header}")
    motion = Motion.from_csv(options.motion or shipped("scara_motion.csv"), options.interpolation)
    return Simulation(
        mechanism,
        motion,
        drive=ComputedTorque(options.bandwidth, options.damping_ratio),
        duration=options.duration,
        step=options.step,
        integrator=options.integrator,
        macro_step=options.macro_step,
        tolerance=options.tolerance,
        record_every=options.record_every,
        joint_friction=_joint_friction(options.joint_friction),
        seed=options.seed,
        start=options.start,
        settle=_settle(options.settle),
        judge_from=options.judge_from,
    )


def _settle(text: str | None) -> float | str | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return text  # of turns, or told what it must be


def _gravity(text: str) -> tuple[float, float, float]:
    from jointplay.study import GRAVITY

    if text in GRAVITY:
        x, y, z = GRAVITY[text]
        return x, y, z
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise JointplayError(
            f"--gravity must be {', '.join(GRAVITY)} or three numbers gx,gy,gz, got {text!r}"
        ) from None
    return x, y, z


def _law(options: argparse.Namespace) -> NormalForceLaw:
    from jointplay.contact import (
        NORMAL_LAWS,
        Anagnostopoulos,
        HuntCrossley,
        KelvinVoigt,
        LinearSpring,
    )

    if options.damping is not None and options.law != "kelvin-voigt":
        raise JointplayError(f"--damping belongs to --law kelvin-voigt, not to {options.law}")
    if options.exponents is not None and options.law != "hunt-crossley":
        raise JointplayError(f"--exponents belongs to --law hunt-crossley, not to {options.law}")
    if options.impact_mass is not None and options.law != "anagnostopoulos":
        raise JointplayError(
            f"--impact-mass belongs to --law anagnostopoulos, not to {options.law}"
        )
    if options.law == "anagnostopoulos":
        if options.impact_mass is None:
            raise JointplayError("--law anagnostopoulos needs --impact-mass [kg]")
        return Anagnostopoulos(options.impact_mass, options.stiffness)
    if options.law == "kelvin-voigt":
        if options.damping is None:
            raise JointplayError("--law kelvin-voigt needs --damping [N s/m]")
        return KelvinVoigt(options.damping, options.stiffness)
    if options.law == "linear-spring":
        return LinearSpring(options.stiffness)
    if options.law == "hunt-crossley":
        return HuntCrossley(*(options.exponents or ()))
    return NORMAL_LAWS[options.law]()


def _joint_friction(entries: Sequence[str]) -> dict[str, JointFriction] | None:
    from jointplay.loads.drive import JointFriction

    if not entries:
        return None
    found = {}
    for entry in entries:
        name, _, values = entry.partition("=")
        try:
            coulomb, viscous = (float(value) for value in values.split(","))
        except ValueError:
            raise JointplayError(
                f"--joint-friction must read JOINT=COULOMB,VISCOUS, got {entry!r}"
            ) from None
        found[name] = JointFriction(coulomb, viscous)
    return found
