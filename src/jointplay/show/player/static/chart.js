// Charts as SVG: pairs of axes and what is drawn between them, in the colours of chart.css.

const SVG = "http://www.w3.org/2000/svg";

function shape(tag, attributes, text) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    return made;
}

// Round steps between low and high, about `count` of them.
function ticks(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * ([1, 2, 5].find(n => n * power >= raw * 0.999) || 10);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found.length > 1 || count > 8 ? found : ticks(low, high, count + 1);  // one alone has no scale
}

// Powers of ten, not many more than `count`; where there are no two of them, 1, 2 and 5 of each.
function decades(low, high, count) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const step = Math.max(1, Math.ceil((last - first) / count)), found = [];
    for (let k = first; k <= last; k += step) found.push(10 ** k);
    if (found.length > 1) return found;
    return [first - 1, first].flatMap(k => [1, 2, 5].map(n => n * 10 ** k)).filter(at => low <= at && at <= high);
}

function said(value, log) {
    const power = Math.round(Math.log10(value));
    if (log && Math.abs(power) > 3 && Math.abs(value / 10 ** power - 1) < 1e-9)
        return `10${String(power).replace(/./g, one => one === "-" ? "\u207b" : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[one])}`;
    const small = value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e6);
    return small ? Number(value.toPrecision(4)).toExponential() : String(Number(value.toPrecision(7)));
}

// From where to where an axis goes: as it says, or over its data.
function rangeOf(axis, series, key) {
    if (axis.range) return axis.range;
    if (axis.rows) return [axis.rows.length - 0.5, -0.5]; // the first stands at the top
    let low = Infinity, high = -Infinity;
    for (const one of series) for (const value of one[key]) {
        if (axis.log && !(value > 0)) continue;
        if (value < low) low = value;
        if (value > high) high = value;
    }
    if (!(low <= high)) return [0.1, 1];
    if (axis.log) return [low / 1.2, high * 1.2];
    if (axis.zero) { low = Math.min(low, 0); high = Math.max(high, 0); }
    const room = (axis.tight && high > low ? 0 : 0.05 * (high - low)) || (high > low ? 0 : Math.abs(0.05 * high) || 1e-9);
    return [axis.zero && low === 0 ? low : low - room, high + room];
}

// Where a value stands, and which one stands somewhere.
function scaleOf({log}, [low, high], from, to) {
    const of = log ? Math.log10 : value => value, back = log ? value => 10 ** value : value => value;
    const first = of(low), step = (to - from) / (of(high) - first);
    return {range: [low, high], at: value => from + (of(value) - first) * step,
        value: place => back(first + (place - from) / step)};
}

function pathOf({x, y, spans}, across, up, dots) {
    const parts = [];
    let pen = "M";
    for (let i = 0; i < x.length; i++) {
        const a = across.at(x[i]), b = up.at(y[i]);
        if (!(Number.isFinite(a) && Number.isFinite(b))) { pen = "M"; continue; }
        if (spans) parts.push(`M${a.toFixed(2)} ${b.toFixed(2)}H${Math.max(across.at(spans[i]), a + 1).toFixed(2)}`);
        else parts.push(`${pen}${a.toFixed(2)} ${b.toFixed(2)}${dots ? "h0" : ""}`);
        pen = dots ? "M" : "L";
    }
    return parts.join("");
}

// Draw a panel into its box of `svg`; gives the panel with the scales of its axes.
//
// A panel has {x, y, series, title, equal, box}; an axis {label, unit} and, where it has them, log,
// rows (words at 0, 1, ...), range, zero (which is shown, too), tight (no room beside the data),
// prefixed (numbers are SI) and bare (without words); a series {name, x, y, colour} and dash, frame
// (no data), dots (their size), line (false: dots alone), or spans (where bars from x end).
function drawPanel(svg, panel) {
    const {box, series} = panel, wide = box.right - box.left, high = box.bottom - box.top;
    let across = rangeOf(panel.x, series, "x"), up = rangeOf(panel.y, series, "y");
    if (panel.equal) {
        const size = Math.max((across[1] - across[0]) / wide, (up[1] - up[0]) / high);
        const about = ([low, end], length) => [0.5 * (low + end - size * length), 0.5 * (low + end + size * length)];
        [across, up] = [about(across, wide), about(up, high)];
    }
    const x = scaleOf(panel.x, across, 0, wide), y = scaleOf(panel.y, up, high, 0);
    const inner = shape("svg", {x: box.left, y: box.top, width: wide, height: high});
    for (const [axis, scale, level] of [[panel.x, x, false], [panel.y, y, true]]) {
        const [low, end] = scale.range, count = Math.max(2, Math.floor(level ? high / 45 : wide / 90));
        const [step, prefix] = axis.prefixed ? prefixOf(Math.max(Math.abs(low), Math.abs(end))) : [1, ""];
        const places = axis.rows ? axis.rows.map((text, k) => [k, text]) :
            (axis.log ? decades(low, end, count) : ticks(low / step, end / step, count)).map(at => [at * step, said(at, axis.log)]);
        for (const [value, text] of places) {
            const at = scale.at(value);
            if (!axis.rows) inner.append(shape("line", {class: "grid", ...(level ? {x1: 0, x2: wide, y1: at, y2: at} : {x1: at, x2: at, y1: 0, y2: high})}));
            if (axis.bare) continue;
            text.split("\n").forEach((line, k, all) => svg.append(level ?
                shape("text", {x: box.left - 5, y: box.top + at + 4 + 12 * (k - (all.length - 1) / 2), "text-anchor": "end"}, line) :
                shape("text", {x: box.left + at, y: box.bottom + 14, "text-anchor": "middle"}, line)));
        }
        const words = axis.unit ? `${axis.label} [${prefix}${axis.unit}]` : axis.label || "";
        if (!axis.bare) svg.append(shape("text", {"text-anchor": "middle", ...(level ?
            {transform: `translate(${box.edge + 11} ${(box.top + box.bottom) / 2}) rotate(-90)`} :
            {x: (box.left + box.right) / 2, y: box.bottom + 30})}, words));
    }
    if (panel.title) svg.append(shape("text", {x: box.left, y: box.top - 6, class: "title"}, panel.title));
    for (const one of series) {
        const width = {[one.line === false ? "dots" : "lines"]: true};
        if (one.dots) width.dots = true;
        for (const kind of Object.keys(width)) {
            const dots = kind === "dots", path = shape("path", {d: pathOf(one, x, y, dots), class: one.spans ? "span" : dots ? "dots" : "curve"});
            path.style.stroke = one.colour;
            if (dots) path.style.strokeWidth = `${one.dots || 5}px`;
            if (one.dash && !dots) path.setAttribute("stroke-dasharray", one.dash);
            path.dataset.name = one.name || "";
            inner.append(path);
        }
    }
    svg.append(inner);
    return {...panel, across: x, up: y, wide, high, inner};
}

// Panels in one SVG, with a key of their series and what stands where the pointer is.
class Chart {
    constructor(attributes = {}) {
        this.svg = shape("svg", {class: "plots", ...attributes});
        this.key = element("p", {class: "key"});
        this.tip = element("div", {class: "tip", hidden: true});
        this.plots = [];
        this.svg.addEventListener("pointermove", event => this.pointed(event));
        this.svg.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    }

    draw(panels, wide, high) {
        this.svg.setAttribute("viewBox", `0 0 ${wide} ${high}`);
        this.svg.replaceChildren();
        this.plots = panels.map(panel => drawPanel(this.svg, panel));
    }

    // Names and lines of series; `parts` stand behind them. `toggle` is called with a name.
    showKey(series, toggle = null, hidden = new Set(), parts = []) {
        const named = new Map(series.filter(one => one.name && !one.frame).map(one => [one.name, one]));
        this.key.replaceChildren(...[...named.values()].map(one => {
            const line = shape("svg", {width: 22, height: 8, "aria-hidden": "true"});
            const stroke = shape("line", {x1: 0, x2: 22, y1: 4, y2: 4, "stroke-width": 2, "stroke-dasharray": one.dash || "none"});
            stroke.style.stroke = one.colour;
            line.append(stroke);
            if (!toggle) return element("span", {}, line, " ", one.name);
            const pressed = String(!hidden.has(one.name));
            return element("button", {type: "button", "aria-pressed": pressed, title: "show or hide", onclick: () => toggle(one.name)}, line, " ", one.name);
        }), ...parts);
    }

    // Where an event is: the plot, and its place in it.
    place(event) {
        const seen = this.svg.getBoundingClientRect(), part = this.svg.viewBox.baseVal.width / seen.width;
        const x = (event.clientX - seen.left) * part, y = (event.clientY - seen.top) * part;
        const plot = this.plots.find(({box}) => box.left <= x && x <= box.right && box.top <= y && y <= box.bottom);
        return plot && {plot, x: x - plot.box.left, y: y - plot.box.top, left: x / part, top: y / part};
    }

    // Say what is nearest to the pointer.
    pointed(event) {
        const at = this.place(event);
        let near = 30, found = null;
        for (const one of at ? at.plot.series : []) for (let i = 0; !one.frame && i < one.x.length; i++) {
            const a = at.plot.across.at(one.x[i]), b = at.plot.up.at(one.y[i]);
            const inside = one.spans && a <= at.x && at.x <= at.plot.across.at(one.spans[i]);
            const away = Math.hypot(inside ? 0 : a - at.x, b - at.y);
            if (away < near) [near, found] = [away, [one, i]];
        }
        this.tip.hidden = !found;
        if (!found) return;
        const [one, i] = found, {x, y} = at.plot;
        const words = (axis, value) => axis.prefixed ? inUnits(value, axis.unit, 5) : `${Number(value.toPrecision(6))} ${axis.unit}`.trim();
        const where = one.spans ? `${words(x, one.x[i])} to ${words(x, one.spans[i])}` :
            one.texts ? `${words(x, one.x[i])}, ${words(y, one.y[i])}, ${one.texts[i]}` : `${words(y, one.y[i])} at ${words(x, one.x[i])}`;
        this.tip.textContent = one.name ? `${one.name}: ${where}` : where;
        const seen = this.svg.getBoundingClientRect(), whole = this.tip.offsetParent.getBoundingClientRect();
        const left = seen.left - whole.left + at.left, right = at.left > seen.width / 2;
        Object.assign(this.tip.style, {top: `${seen.top - whole.top + at.top + 14}px`, left: right ? "auto" : `${left + 12}px`,
            right: right ? `${whole.width - left + 12}px` : "auto"});
    }

    // The chart and its key as a file, with the colours of now.
    file(title) {
        const made = this.svg.cloneNode(true), from = [...this.svg.querySelectorAll("*")];
        [...made.querySelectorAll("*")].forEach((one, k) => {
            const look = getComputedStyle(from[k]);
            for (const name of ["fill", "stroke", "stroke-width", "stroke-linecap", "font-size", "font-family"]) one.setAttribute(name, look.getPropertyValue(name));
            one.removeAttribute("style");
        });
        const {width, height} = this.svg.viewBox.baseVal, look = getComputedStyle(this.svg);
        const words = {fill: getComputedStyle(this.key).color, "font-size": "12px", "font-family": look.fontFamily};
        [...this.key.children].filter(one => one.querySelector("svg")).forEach((one, k) => {
            const line = one.querySelector("line").cloneNode();
            line.setAttribute("stroke", getComputedStyle(one.querySelector("line")).stroke);
            line.setAttribute("transform", `translate(10 ${height + 16 * k})`);
            made.append(line, shape("text", {x: 38, y: height + 16 * k + 8, ...words}, one.textContent.trim()));
        });
        const all = height + 16 * this.key.children.length + 8;
        for (const [name, value] of Object.entries({xmlns: SVG, width, height: all, viewBox: `0 0 ${width} ${all}`})) made.setAttribute(name, value);
        made.prepend(shape("rect", {width: "100%", height: "100%", fill: look.backgroundColor}));
        const url = URL.createObjectURL(new Blob([new XMLSerializer().serializeToString(made)], {type: "image/svg+xml"}));
        element("a", {href: url, download: `${title}.svg`}).click();
        setTimeout(() => URL.revokeObjectURL(url), 1000);
    }
}
