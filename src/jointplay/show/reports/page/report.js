"use strict";
(() => {
  // Intervals of a window, of each the smallest and the largest value: less than half a pixel wide,
  // as the widest chart has 990 px between its axes. A line is nowhere farther from its records.
  const BINS = 2400;
  const SINGLE = 400; // fewer points than this in view are marked one by one
  const page = JSON.parse(document.getElementById("charts").textContent);
  const state = { range: null, drawn: 0, ready: false };
  window.jointplayReport = state;

  // The block: gzip of arrays, each the differences of its bit patterns, bytes of equal weight together.
  async function unpack() {
    const text = atob(document.getElementById("block").textContent.trim());
    const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  let block = null;
  const starts = [];
  let total = 0;
  for (const [, size] of page.layout) {
    starts.push(total);
    total += 4 * size;
  }
  const cache = new Map();
  function series(number) {
    if (!cache.has(number)) {
      const [kind, n] = page.layout[number];
      const at = starts[number];
      const bits = new Uint32Array(n);
      let value = 0;
      for (let i = 0; i < n; i++) {
        value += block[at + i] + block[at + n + i] * 0x100 + block[at + 2 * n + i] * 0x10000 +
          block[at + 3 * n + i] * 0x1000000;
        value = value >>> 0;
        bits[i] = value;
      }
      cache.set(number, kind === "u" ? bits : new Float32Array(bits.buffer));
    }
    return cache.get(number);
  }

  // First index whose entry is not below `value`.
  function search(sorted, value) {
    let low = 0, high = sorted.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  const window_ = () => state.range || [0, page.end];

  // Indices in view, one beyond each end.
  function inView(steps, dt) {
    const [from, to] = window_();
    return [Math.max(0, search(steps, from / dt) - 1), Math.min(steps.length, search(steps, to / dt) + 1)];
  }

  // What is in view of a series: every point, or of each of `BINS` intervals smallest and largest.
  function reduce(trace) {
    const steps = series(trace.t), values = series(trace.y), dt = trace.dt;
    const [first, end] = inView(steps, dt);
    const x = [], y = [];
    const put = (i) => { x.push(steps[i] * dt); y.push(values[i]); };
    if (end - first <= 2 * BINS) {
      for (let i = first; i < end; i++) put(i);
      return { x, y, count: end - first };
    }
    const width = (steps[end - 1] - steps[first]) / BINS;
    let i = first;
    for (let bin = 1; bin <= BINS && i < end; bin++) {
      const limit = bin === BINS ? Infinity : steps[first] + bin * width;
      let low = -1, high = -1;
      for (; i < end && steps[i] < limit; i++) {
        if (Number.isNaN(values[i])) continue;
        if (low < 0 || values[i] < values[low]) low = i;
        if (high < 0 || values[i] > values[high]) high = i;
      }
      if (low < 0) continue;
      put(Math.min(low, high));
      if (low !== high) put(Math.max(low, high));
    }
    return { x, y, count: Infinity };
  }

  // A curve in view, without points closer than 1/2400 of its extent to the last one.
  function curve(trace) {
    const steps = series(trace.t), xs = series(trace.x), ys = series(trace.y);
    const [first, end] = inView(steps, trace.dt);
    let left = Infinity, right = -Infinity, low = Infinity, high = -Infinity;
    for (let i = first; i < end; i++) {
      left = Math.min(left, xs[i]); right = Math.max(right, xs[i]);
      low = Math.min(low, ys[i]); high = Math.max(high, ys[i]);
    }
    const near = end - first > 2 * SINGLE ? Math.max(right - left, high - low) / BINS : 0;
    const x = [], y = [], text = [];
    let last = -1;
    for (let i = first; i < end; i++) {
      if (last >= 0 && i < end - 1 && Math.hypot(xs[i] - xs[last], ys[i] - ys[last]) < near) continue;
      x.push(xs[i]); y.push(ys[i]); text.push(`t = ${(steps[i] * trace.dt).toPrecision(7)} s`);
      last = i;
    }
    return { x, y, text, count: end - first };
  }

  // Bars of a timeline in view; bars that would share a pixel are one.
  function spans(trace) {
    const from = series(trace.from), to = series(trace.to), dt = trace.dt;
    const [left, right] = window_();
    const pixel = (right - left) / BINS;
    const x = [], y = [];
    for (let i = search(to, left / dt); i < from.length && from[i] * dt <= right; i++) {
      const a = from[i] * dt, b = to[i] * dt;
      const n = x.length;
      if (n && a - x[n - 2] < pixel) x[n - 2] = b;
      else { x.push(a, Math.max(b, a), null); y.push(-trace.row, -trace.row, null); }
    }
    return { x, y };
  }

  // Plotly takes text for HTML of its own kind; names are not.
  const plain = (name) => String(name).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const number = (i) => (i === 0 ? "" : String(i + 1));

  // What a variable of report.css stands for now, in the dark or on paper.
  const probe = document.body.appendChild(document.createElement("i"));
  probe.hidden = true;
  function colour(name) {
    probe.style.color = `var(--${name})`;
    return getComputedStyle(probe).color;
  }

  // A case's colour, lighter in the dark.
  function tone(given) {
    if (given === "black") return colour("ink");
    if (!isDark()) return given;
    const mixed = [1, 3, 5].map((i) => Math.round(0.7 * parseInt(given.slice(i, i + 2), 16) + 76));
    return `rgb(${mixed.join(",")})`;
  }

  function build(chart, wide) {
    const ink = colour("ink"), line = colour("axis"), paper = colour("paper");
    const FONT = { family: "system-ui, sans-serif", size: 12, color: ink };
    const AXIS = { gridcolor: colour("grid"), zerolinecolor: line, linecolor: line, ticks: "outside",
      ticklen: 4, tickcolor: line, automargin: true };
    const most = wide < 640 ? 1 : wide < 900 ? 2 : 3; // panels side by side
    const seen = new Set();
    const data = [], annotations = [], shapes = [];
    const layout = { font: FONT, paper_bgcolor: paper, plot_bgcolor: paper, annotations, shapes,
      modebar: { bgcolor: "rgba(0,0,0,0)", color: line, activecolor: ink },
      margin: { l: wide < 640 ? 56 : 76, r: 16, t: 34, b: 44 }, hovermode: "closest", uirevision: "keep",
      legend: { orientation: "h", x: 0, y: 1, yref: "container", yanchor: "top" } };
    const { time, stacked } = chart;
    const count = chart.panels.length;
    const columns = stacked ? 1 : Math.min(count, most);
    const rows = Math.ceil(count / columns);
    const rowHeight = chart.panels[0].y.rows ? 100 : stacked ? (count > 4 ? 150 : 175) : Math.min(400, wide);
    const titled = chart.panels.some((panel) => panel.title);
    const gap = (titled ? 26 : 14) / (rows * rowHeight);
    layout.height = rows * rowHeight + 90;
    const across = columns > 1 ? 0.075 : 0;
    const down = stacked ? gap : 74 / (rows * rowHeight);
    chart.panels.forEach((panel, i) => {
      const row = Math.floor(i / columns), column = i % columns;
      const high = (1 - (rows - 1) * down) / rows, wide = (1 - (columns - 1) * across) / columns;
      const top = 1 - row * (high + down), left = column * (wide + across);
      const n = number(i), xn = stacked ? "" : n;
      const titleOf = (axis) => ({ text: plain(axis.label), standoff: 6 });
      const y = layout["yaxis" + n] = { ...AXIS, domain: [Math.max(0, top - high), top], anchor: "x" + xn,
        title: titleOf(panel.y) };
      const x = layout["xaxis" + xn] = layout["xaxis" + xn] || { ...AXIS, title: titleOf(panel.x),
        ...(stacked ? { anchor: "y" + number(count - 1) } : { domain: [left, left + wide], anchor: "y" + n }) };
      if (time) y.fixedrange = true;
      if (panel.equal) { y.scaleanchor = "x" + n; y.constrain = x.constrain = "domain"; }
      if (panel.x.log) Object.assign(x, { type: "log", dtick: 1, exponentformat: "power" });
      if (panel.y.log) {
        let low = Infinity, high = 0;
        for (const trace of panel.traces) for (const value of series(trace.y)) {
          if (value > 0) { low = Math.min(low, value); high = Math.max(high, value); }
        }
        const dtick = Math.max(1, Math.ceil(Math.log10(high / low) / 5)); // five labels or so
        Object.assign(y, { type: "log", exponentformat: "power", dtick });
      }
      if (chart.same && i) y.matches = "y";
      if (panel.y.rows) {
        const words = panel.y.rows.map((one) => plain(one).replace("\n", "<br>"));
        Object.assign(y, { tickvals: words.map((_, k) => -k), ticktext: words, showgrid: false, zeroline: false,
          range: [0.5 - words.length, 0.5] });
      }
      if (panel.title) annotations.push({ text: plain(panel.title), xref: "paper", yref: "paper", x: left,
        y: top, xanchor: "left", yanchor: "bottom", showarrow: false, font: { size: 11.5 } });
      for (const trace of panel.traces) {
        const name = plain(trace.name || panel.title);
        const base = { name, legendgroup: name, showlegend: Boolean(trace.name) && !seen.has(name),
          hovertemplate: `%{y:.5~g} ${plain(panel.y.unit)} at %{x:.6~g} ${plain(panel.x.unit)}`,
          xaxis: "x" + xn, yaxis: "y" + n, type: "scatter", ...(trace.frame ? { hoverinfo: "skip" } : {}) };
        if (trace.name) seen.add(name);
        const color = tone(trace.color);
        // Plotly's own simplification would leave polygons of smooth curves.
        const line = { color, width: 1.2, dash: trace.dash || "solid", simplify: false };
        if (trace.from !== undefined) {
          data.push({ ...base, ...spans(trace), mode: "lines", hovertemplate: "%{x:.6~g} s", line: { color, width: 16 } });
        } else if (trace.t !== undefined) {
          const { count: points, ...drawn } = trace.x === undefined ? reduce(trace) : curve(trace);
          data.push({ ...base, ...drawn, line, mode: points <= SINGLE ? "lines+markers" : "lines",
            marker: { size: 4, color } });
        } else {
          data.push({ ...base, x: Array.from(series(trace.x)), y: Array.from(series(trace.y)), line,
            mode: trace.dash ? "lines" : "markers", marker: { size: 5, color, opacity: 0.7 } });
        }
      }
    });
    if (time) layout.xaxis.range = window_();
    layout.showlegend = seen.size > 1;
    return { data, layout };
  }

  const config = { responsive: true, displaylogo: false,
    modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"],
    toImageButtonOptions: { format: "svg" } };
  const hosts = new Map(); // host element -> {chart, visible, stale}

  async function draw(host) {
    const entry = hosts.get(host);
    entry.stale = false;
    entry.wide = host.clientWidth;
    const { data, layout } = build(entry.chart, entry.wide);
    await Plotly.react(host, data, layout, config);
    if (!entry.listens) {
      entry.listens = true;
      state.drawn += 1;
      host.classList.add("drawn");
      if (entry.chart.time) host.on("plotly_relayout", zoomed);
    }
  }

  // Off the screen, charts are drawn one by one while nothing else is to do: they must be there to be
  // printed and searched.
  const PAPER = 686;  // CSS px between the margins of the printed page
  function drawRest() {
    const next = [...hosts].find(([, entry]) => entry.stale);
    if (!next) { state.whole = true; return; }
    draw(next[0]).then(() => later(drawRest));
  }
  const later = window.requestIdleCallback || ((act) => setTimeout(act, 20));

  function fit() {
    document.documentElement.style.setProperty("--bar", `${document.querySelector("nav").offsetHeight}px`);
    const host = document.querySelector(".chart");
    if (host) document.documentElement.style.setProperty("--fit", String(Math.min(1, PAPER / host.clientWidth)));
  }

  // Paper is white: charts are drawn anew where the screen is dark.
  let theme = "";
  function beforePrint() {
    // Tables, but not the text of the robot.
    for (const details of document.querySelectorAll("details:not(:has(pre))")) details.open = true;
    theme = document.documentElement.dataset.theme || "";
    const restyled = isDark();
    document.documentElement.dataset.theme = "light";
    for (const [host, entry] of hosts) if (entry.stale || restyled) draw(host);
  }
  function afterPrint() {
    setTheme(theme);
  }

  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (document.documentElement.dataset.theme || (system.matches ? "dark" : "light")) === "dark";
  function setTheme(name) {
    if (name) document.documentElement.dataset.theme = name;
    else delete document.documentElement.dataset.theme;
    document.getElementById("theme").textContent = isDark() ? "light" : "dark";
    for (const entry of hosts.values()) entry.stale = true;
    refresh();
    later(drawRest);
  }

  function zoomed(event) {
    const range = event["xaxis.range"] || (event["xaxis.range[0]"] !== undefined &&
      [event["xaxis.range[0]"], event["xaxis.range[1]"]]);
    if (range) show(range.map(Number));
    else if (event["xaxis.autorange"]) show(null);
  }

  const from = document.getElementById("from"), to = document.getElementById("to");
  let waiting = false;
  function show(range) {
    const buttons = { whole: !range, judged: Boolean(range) && range[0] === page.start && range[1] === page.end };
    for (const [id, on] of Object.entries(buttons)) document.getElementById(id)?.setAttribute("aria-pressed", String(on));
    if (range) {
      let [a, b] = range;
      a = Math.max(0, a); b = Math.min(page.end, b);
      if (!(b > a)) return;
      range = a <= 0 && b >= page.end ? null : [a, b];
    }
    state.range = range;
    const [a, b] = window_();
    from.value = Number(a.toPrecision(8)); to.value = Number(b.toPrecision(8));
    for (const entry of hosts.values())
      if (entry.chart.time || entry.chart.panels.some((panel) => panel.equal)) entry.stale = true;
    if (!waiting) {
      waiting = true;
      requestAnimationFrame(() => { waiting = false; refresh(); });
    }
  }
  state.show = show;

  function refresh() {
    for (const [host, entry] of hosts) if (entry.visible && entry.stale) draw(host);
  }

  async function begin() {
    try {
      block = await unpack();
    } catch (error) {
      document.getElementById("failed").hidden = false;
      throw error;
    }
    const watch = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) hosts.get(target).visible = isIntersecting;
      refresh();
    }, { rootMargin: "400px" });
    for (const chart of page.charts) {
      const host = document.getElementById("chart-" + chart.id);
      hosts.set(host, { chart, visible: false, stale: true });
      watch.observe(host);
    }
    document.getElementById("zoom").addEventListener("submit", (event) => event.preventDefault());
    const read = () => show([Number(from.value), Number(to.value)]);
    from.addEventListener("change", read);
    to.addEventListener("change", read);
    document.getElementById("whole").addEventListener("click", () => show(null));
    document.getElementById("judged")?.addEventListener("click", () => show([page.start, page.end]));
    document.getElementById("wider").addEventListener("click", () => {
      const [a, b] = window_();
      show([a - 1.5 * (b - a), b + 1.5 * (b - a)]);
    });
    for (const button of document.querySelectorAll("button[data-zoom]")) {
      button.addEventListener("click", () => {
        show(button.dataset.zoom.split(",").map(Number));
        document.getElementById("chart-contacts").scrollIntoView({ block: "center" });
      });
    }
    document.getElementById("theme").addEventListener("click", () => setTheme(isDark() ? "light" : "dark"));
    system.addEventListener("change", () => setTheme(document.documentElement.dataset.theme || ""));
    setTheme("");
    show(page.start > 0 ? [page.start, page.end] : null);
    fit();
    window.addEventListener("resize", () => {
      fit();
      for (const [host, entry] of hosts) if (host.clientWidth !== entry.wide) entry.stale = true;
      refresh();
    });
    window.addEventListener("beforeprint", beforePrint);
    window.addEventListener("afterprint", afterPrint);
    later(drawRest);
    state.ready = true;
  }
  begin();
})();
