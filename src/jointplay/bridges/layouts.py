"""Layouts of charts for the bag of a result: files that PlotJuggler and Foxglove open with it.

Both show the same charts. PlotJuggler 3 calls a number ``/topic/field/x``, and those of joint
states ``/joint_states/JOINT/position`` (its source, ParserROS); Foxglove and Lichtblick write
message paths, ``/topic.field.x`` and ``/joint_states.position[0]``.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from jointplay.bridges.bag import joint_topic
from jointplay.bridges.table import EFFORT_UNITS
from jointplay.bridges.trajectory import encoders
from jointplay.show.plots.palette import AXIS_COLOURS, COLOURS
from jointplay.simulation.result.result import AXES, Result

_STATES = "/joint_states"


@dataclass(frozen=True)
class Curve:
    """One number of a topic's messages over time."""

    topic: str
    fields: tuple[str, ...]
    label: str
    joint: int | None = None
    """Of joint states: index of the joint."""


@dataclass(frozen=True)
class Chart:
    """Curves over time, or the second over the first."""

    title: str
    curves: tuple[Curve, ...]
    over_each_other: bool = False


def charts(result: Result) -> dict[str, list[Chart]]:
    """Charts by tab: the machine, and each joint with clearance."""
    machine = [
        Chart("Tool position, world axes [m]", _vector("/tool_pose", "pose", "position")),
        Chart("Tool velocity, world axes [m/s]", _vector("/tool_twist", "twist", "linear")),
    ]
    units = result.dataset["coordinate_unit"].values
    for unit, kind in (("rad", "Joints"), ("m", "Sliding joints")):
        names = [(i, n) for i, (n, at) in enumerate(encoders(result).items()) if units[at] == unit]
        drive = f"drive [{EFFORT_UNITS[unit]}]"
        for field, what in (("position", f"position [{unit}]"), ("effort", drive)):
            if names:
                curves = tuple(Curve(_STATES, (field,), name, i) for i, name in names)
                machine.append(Chart(f"{kind}, {what}", curves))
    tabs = {"machine": machine}
    for joint in result.joints:
        place = joint_topic(joint)
        centre = _vector(f"{place}/journal_centre", "vector")
        tabs[joint] = [
            Chart(f"{joint}: contact force, world axes [N]", _vector(f"{place}/force", "vector")),
            Chart(f"{joint}: journal centre, bearing axes [m]", centre),
            Chart(f"{joint}: journal centre, y over x [m]", centre[:2], over_each_other=True),
        ]
    return tabs


def _vector(topic: str, *fields: str) -> tuple[Curve, ...]:
    return tuple(Curve(topic, (*fields, axis), axis) for axis in AXES)


def plotjuggler(result: Result, suffix: str, progress: bool) -> bytes:
    """A layout for PlotJuggler 3: ``plotjuggler -d run.mcap -l run.xml``."""
    root = ElementTree.Element("root")
    window = ElementTree.SubElement(
        root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"}
    )
    for name, each in charts(result).items():
        tab = ElementTree.SubElement(window, "Tab", {"tab_name": name, "containers": "1"})
        container = ElementTree.SubElement(tab, "Container")
        rows = [each[first : first + 2] for first in range(0, len(each), 2)]
        down = _splitter(container, "-", len(rows))
        for row in rows:
            across = _splitter(down, "|", len(row)) if len(row) > 1 else down
            for chart in row:
                area = ElementTree.SubElement(across, "DockArea", {"name": chart.title})
                _plot(area, chart)
    ElementTree.SubElement(window, "currentTabIndex", {"index": "0"})
    ElementTree.SubElement(root, "use_relative_time_offset", {"enabled": "1"})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _splitter(parent: ElementTree.Element, way: str, count: int) -> ElementTree.Element:
    """Equal parts beside each other (``|``) or above each other (``-``)."""
    sizes = ";".join([f"{1.0 / count:.6g}"] * count)
    place = {"orientation": way, "count": str(count), "sizes": sizes}
    return ElementTree.SubElement(parent, "DockSplitter", place)


def _plot(area: ElementTree.Element, chart: Chart) -> None:
    mode = "XYPlot" if chart.over_each_other else "TimeSeries"
    look = {"mode": mode, "style": "Lines", "flip_x": "false", "flip_y": "false"}
    plot = ElementTree.SubElement(area, "plot", look)
    names = [
        "/".join((curve.topic, *(() if curve.joint is None else (curve.label,)), *curve.fields))
        for curve in chart.curves
    ]
    pairs = enumerate(zip(names, chart.curves, strict=True))
    styles = [{"name": name, "color": _colour(curve, k)} for k, (name, curve) in pairs]
    if chart.over_each_other:
        styles = [{"name": chart.title, "color": COLOURS[0]}]
        styles[0] |= {"curve_x": names[0], "curve_y": names[1]}
    for style in styles:
        ElementTree.SubElement(plot, "curve", style)


def _colour(curve: Curve, number: int) -> str:
    return AXIS_COLOURS.get(curve.label, COLOURS[number % len(COLOURS)])


def foxglove(result: Result, suffix: str, progress: bool) -> bytes:
    """A layout for Foxglove and Lichtblick: "Import from file" in the layouts' menu."""
    panels: dict[str, Any] = {}
    tabs = []
    for name, each in charts(result).items():
        keys = [f"Plot!{len(panels) + k}" for k in range(len(each))]
        panels |= dict(zip(keys, map(_panel, each), strict=True))
        rows = [_mosaic(keys[first : first + 2], "row") for first in range(0, len(keys), 2)]
        tabs.append({"title": name, "layout": _mosaic(rows, "column")})
    panels["Tab!tabs"] = {"activeTabIdx": 0, "tabs": tabs}
    layout = {
        **{"configById": panels, "globalVariables": {}, "userNodes": {}, "layout": "Tab!tabs"},
        "playbackConfig": {"speed": 0.1},
    }
    return json.dumps(layout, indent=1).encode() + b"\n"


def _panel(chart: Chart) -> dict[str, Any]:
    paths = []
    for number, curve in enumerate(chart.curves):
        index = "" if curve.joint is None else f"[{curve.joint}]"
        value, colour = f"{curve.topic}.{'.'.join(curve.fields)}{index}", _colour(curve, number)
        look = {"enabled": True, "label": curve.label, "timestampMethod": "headerStamp"}
        paths.append({"value": value, "color": colour, **look})
    shown = ("showXAxisLabels", "showYAxisLabels", "showLegend", "isSynced")
    panel: dict[str, Any] = {
        **{"foxglovePanelTitle": chart.title, "paths": paths, "xAxisVal": "timestamp"},
        **dict.fromkeys(shown, True),
        **{"legendDisplay": "floating", "showPlotValuesInLegend": False, "sidebarDimension": 240},
    }
    if chart.over_each_other:
        first = {"value": paths[0]["value"], "enabled": True}
        panel |= {"paths": paths[1:], "xAxisVal": "custom", "xAxisPath": first, "isSynced": False}
    return panel


def _mosaic(parts: list[Any], way: str) -> Any:
    if len(parts) == 1:
        return parts[0]
    half = math.ceil(len(parts) / 2)
    return {
        "direction": way,
        "first": _mosaic(parts[:half], way),
        "second": _mosaic(parts[half:], way),
        "splitPercentage": 100.0 * half / len(parts),
    }
