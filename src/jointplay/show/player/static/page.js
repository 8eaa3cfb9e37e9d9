// Shared by all pages: numbers with units, and HTML elements.

const PREFIXES = [[1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "\u00b5"], [1e-9, "n"]];

function prefixOf(size) {
    return PREFIXES.find(([step]) => size >= 0.9995 * step) || PREFIXES[PREFIXES.length - 1];
}

// A number with its unit and so many digits.
function inUnits(value, unit, digits = 3) {
    if (value === null || value === undefined) return "\u2013";
    if (value === 0) return `0 ${unit}`.trim();
    if (!unit || unit === "%") return `${Number(value.toPrecision(digits))} ${unit}`.trim();
    const [step, prefix] = prefixOf(Math.abs(value));
    return `${Number((value / step).toPrecision(digits))} ${prefix}${unit}`;
}

// Offer content (a blob) as a file.
function download(content, name) {
    const link = element("a", {href: URL.createObjectURL(content), download: name});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// An element with attributes and children; strings become text nodes, never HTML.
function element(tag, attributes = {}, ...children) {
    const node = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
        if (value === null || value === undefined || value === false) continue;
        if (name.startsWith("on")) node[name] = value;
        else node.setAttribute(name, value === true ? "" : value);
    }
    node.append(...children);
    return node;
}
