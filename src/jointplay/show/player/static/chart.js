// Charts as SVG: panels with axes, curves, bars and dots, in the colours of chart.css.

const SVG = "http://www.w3.org/2000/svg";

function shape(tag, attributes, text) {
    const node = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    if (text !== undefined) node.textContent = text;
    return node;
}

// Round steps between low and high, about `count` of them.
function ticks(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * ([1, 2, 5].find(n => n * power >= raw * 0.999) || 10);
    const places = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) places.push(k * step);
    return places.length > 1 || count > 8 ? places : ticks(low, high, count + 1);  // one alone shows no scale
}

// Powers of ten, not many more than `count`; where there are no two of them, 1, 2 and 5 of each.
function decades(low, high, count) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const step = Math.max(1, Math.ceil((last - first) / count)), powers = [];
    for (let k = first; k <= last; k += step) powers.push(10 ** k);
    if (powers.length > 1) return powers;
    return [first - 1, first].flatMap(k => [1, 2, 5].map(n => n * 10 ** k)).filter(at => low <= at && at <= high);
}

// A tick's number as text; on logarithmic axes small and large powers of ten are written as such.
function tickText(value, log) {
    const power = Math.round(Math.log10(value));
    if (log && Math.abs(power) > 3 && Math.abs(value / 10 ** power - 1) < 1e-9)
        return `10${String(power).replace(/./g, digit => digit === "-" ? "\u207b" : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[digit])}`;
    const small = value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e6);
    return small ? Number(value.toPrecision(4)).toExponential() : String(Number(value.toPrecision(7)));
}

// Limits of an axis: its own, or those of its data with some room.
function rangeOf(axis, series, key) {
    if (axis.range) return axis.range;
    if (axis.rows) return [axis.rows.length - 0.5, -0.5]; // the first stands at the top
    let low = Infinity, high = -Infinity;
    for (const curve of series) for (const value of curve[key]) {
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

// A scale: `at` gives the place of a value, `value` that at a place.
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

// Draw a panel into its box of `svg`; returns the panel with the scales of its axes.
//
// A panel has {x, y, series, title, equal, box}; an axis {label, unit} and, where it has them, log,
// rows (labels at 0, 1, ...), range, zero (whether it includes 0), tight (no room beside the data),
// prefixed (numbers are SI, and get a prefix) and bare (without texts); a series {name, x, y, colour}
// and, where it has them, dash, frame (not data), dots (their size), line (false: dots alone), or spans
// (the ends of bars from x).
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
            (axis.log ? decades(low, end, count) : ticks(low / step, end / step, count)).map(at => [at * step, tickText(at, axis.log)]);
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
    for (const curve of series) {
        const kinds = curve.line === false ? ["dots"] : curve.dots ? ["lines", "dots"] : ["lines"];
        for (const kind of kinds) {
            const dots = kind === "dots", path = shape("path", {d: pathOf(curve, x, y, dots), class: curve.spans ? "span" : dots ? "dots" : "curve"});
            path.style.stroke = curve.colour;
            if (dots) path.style.strokeWidth = `${curve.dots || 5}px`;
            if (curve.dash && !dots) path.setAttribute("stroke-dasharray", curve.dash);
            path.dataset.name = curve.name || "";
            inner.append(path);
        }
    }
    svg.append(inner);
    return {...panel, across: x, up: y, wide, high, inner};
}

// Panels in one SVG, with a legend (`key`) and a tip that tells the point nearest to the pointer.
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

    // Fill the legend; `parts` stand behind the names. A click on a name calls `toggle` with it.
    showKey(series, toggle = null, hidden = new Set(), parts = []) {
        const named = new Map(series.filter(({name, frame}) => name && !frame).map(curve => [curve.name, curve]));
        this.key.replaceChildren(...[...named.values()].map(({name, dash, colour}) => {
            const line = shape("svg", {width: 22, height: 8, "aria-hidden": "true"});
            const stroke = shape("line", {x1: 0, x2: 22, y1: 4, y2: 4, "stroke-width": 2, "stroke-dasharray": dash || "none"});
            stroke.style.stroke = colour;
            line.append(stroke);
            if (!toggle) return element("span", {}, line, " ", name);
            const pressed = String(!hidden.has(name));
            return element("button", {type: "button", "aria-pressed": pressed, title: "show or hide", onclick: () => toggle(name)}, line, " ", name);
        }), ...parts);
    }

    // The panel at an event, and the event's place in it.
    place(event) {
        const seen = this.svg.getBoundingClientRect(), part = this.svg.viewBox.baseVal.width / seen.width;
        const x = (event.clientX - seen.left) * part, y = (event.clientY - seen.top) * part;
        const plot = this.plots.find(({box}) => box.left <= x && x <= box.right && box.top <= y && y <= box.bottom);
        return plot && {plot, x: x - plot.box.left, y: y - plot.box.top, left: x / part, top: y / part};
    }

    // Show in the tip the point of a series that is nearest to the pointer.
    pointed(event) {
        const at = this.place(event);
        let least = 30, nearest = null;  // within 30 px
        for (const curve of at ? at.plot.series : []) for (let i = 0; !curve.frame && i < curve.x.length; i++) {
            const a = at.plot.across.at(curve.x[i]), b = at.plot.up.at(curve.y[i]);
            const inside = curve.spans && a <= at.x && at.x <= at.plot.across.at(curve.spans[i]);
            const distance = Math.hypot(inside ? 0 : a - at.x, b - at.y);
            if (distance < least) [least, nearest] = [distance, [curve, i]];
        }
        this.tip.hidden = !nearest;
        if (!nearest) return;
        const [curve, i] = nearest, {x, y} = at.plot;
        const number = (axis, value) => axis.prefixed ? inUnits(value, axis.unit, 5) : `${Number(value.toPrecision(6))} ${axis.unit}`.trim();
        const where = curve.spans ? `${number(x, curve.x[i])} to ${number(x, curve.spans[i])}` :
            curve.texts ? `${number(x, curve.x[i])}, ${number(y, curve.y[i])}, ${curve.texts[i]}` : `${number(y, curve.y[i])} at ${number(x, curve.x[i])}`;
        this.tip.textContent = curve.name ? `${curve.name}: ${where}` : where;
        const seen = this.svg.getBoundingClientRect(), whole = this.tip.offsetParent.getBoundingClientRect();
        const left = seen.left - whole.left + at.left, right = at.left > seen.width / 2;
        Object.assign(this.tip.style, {top: `${seen.top - whole.top + at.top + 14}px`, left: right ? "auto" : `${left + 12}px`,
            right: right ? `${whole.width - left + 12}px` : "auto"});
    }

    // Offer chart and legend as an SVG file, in the colours of the page now.
    file(title) {
        const copy = this.svg.cloneNode(true), from = [...this.svg.querySelectorAll("*")];
        [...copy.querySelectorAll("*")].forEach((node, k) => {
            const look = getComputedStyle(from[k]);
            for (const name of ["fill", "stroke", "stroke-width", "stroke-linecap", "font-size", "font-family"]) node.setAttribute(name, look.getPropertyValue(name));
            node.removeAttribute("style");
        });
        const {width, height} = this.svg.viewBox.baseVal, look = getComputedStyle(this.svg);
        const font = {fill: getComputedStyle(this.key).color, "font-size": "12px", "font-family": look.fontFamily};
        [...this.key.children].filter(entry => entry.querySelector("svg")).forEach((entry, k) => {
            const line = entry.querySelector("line").cloneNode();
            line.setAttribute("stroke", getComputedStyle(entry.querySelector("line")).stroke);
            line.setAttribute("transform", `translate(10 ${height + 16 * k})`);
            copy.append(line, shape("text", {x: 38, y: height + 16 * k + 8, ...font}, entry.textContent.trim()));
        });
        const all = height + 16 * this.key.children.length + 8;
        for (const [name, value] of Object.entries({xmlns: SVG, width, height: all, viewBox: `0 0 ${width} ${all}`})) copy.setAttribute(name, value);
        copy.prepend(shape("rect", {width: "100%", height: "100%", fill: look.backgroundColor}));
        download(new Blob([new XMLSerializer().serializeToString(copy)], {type: "image/svg+xml"}), `${title}.svg`);
    }
}
