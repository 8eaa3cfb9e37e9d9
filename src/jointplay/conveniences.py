"""Where methods of lower layers, such as `result.plot`, find what they need of upper layers.

Each is imported when it is first called: lower layers import nothing from upper ones.
"""

from jointplay.base.conveniences import places

places |= {
    "plots": ("jointplay.show.plots", "Plots"),
    "dataframe": ("jointplay.bridges.table", "dataframe"),
    "export": ("jointplay.bridges", "export"),
    "notebook_page": ("jointplay.bridges.notebook", "page"),
    "in_a_line": ("jointplay.simulation.analysis.headline", "in_a_line"),
    "summary": ("jointplay.simulation.analysis.headline", "summary"),
    "tool_error": ("jointplay.simulation.analysis.parts", "ToolError"),
    "find_tool_error": ("jointplay.simulation.analysis.tool_error", "find_tool_error"),
    "rattle": ("jointplay.simulation.analysis.vibration", "rattle"),
    "simulation": ("jointplay.simulation", "Simulation"),
    "errors_of_run": ("jointplay.study.certification", "errors_if_possible"),
}
