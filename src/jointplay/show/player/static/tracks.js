// Tracks: tables of numbers over the moments that are played, and interpolation in them.

// A compressed block of bytes, inflated; it is base64 in pages, bytes in a server's answers.
async function inflate(block) {
    const packed = typeof block === "string" ? Uint8Array.from(atob(block), one => one.charCodeAt(0)) : block;
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The numbers of 32 bits that Packer.integers in tracks.py packed, bytes of equal weight together.
function integers(block, at, count) {
    const numbers = new Uint32Array(count);
    for (let k = 0; k < 4; k++)
        for (let i = 0; i < count; i++) numbers[i] += block[at + k * count + i] * 2 ** (8 * k);
    return numbers;
}

// Table (rows x columns, row by row) that Packer.table in tracks.py packed.
function unpack(block, entry, type = Float32Array) {
    const {rows, columns, quantum} = entry;
    const zigzags = integers(block, entry.at, rows * columns), values = new type(zigzags.length);
    for (let c = 0, at = 0; c < columns; c++) {
        let whole = 0;
        for (let r = 0; r < rows; r++, at++) {
            const zigzag = zigzags[at];
            whole += zigzag % 2 ? -(zigzag + 1) / 2 : zigzag / 2;
            values[r * columns + c] = whole * quantum;
        }
    }
    return {rows, columns, values};
}

// Points' numbers (three a triangle) that Packer.mesh in tracks.py packed.
function unpackMesh(block, {at, numbers}) {
    const behind = integers(block, at, numbers);
    let fresh = 0;
    return behind.map(distance => distance ? fresh - distance : fresh++);
}

// The first row whose time is not before t, or the last row.
function rowAt(time, t) {
    let low = 0, high = time.length - 1;
    while (low < high) {
        const middle = (low + high) >> 1;
        if (time[middle] < t) low = middle + 1; else high = middle;
    }
    return low;
}

// The rows a and b around t, and the weight of b.
function between(time, t) {
    const b = rowAt(time, t), a = Math.max(b - 1, 0);
    const span = time[b] - time[a];
    return {a, b, share: span > 0 ? Math.min(Math.max((t - time[a]) / span, 0), 1) : 1};
}

// A column of a table, interpolated.
function valueAt({values, columns}, {a, b, share}, column) {
    const before = values[a * columns + column];
    return before + share * (values[b * columns + column] - before);
}

// Columns [from, from + 3) of a table, interpolated.
function vectorAt(table, place, from, out) {
    return out.set(valueAt(table, place, from), valueAt(table, place, from + 1), valueAt(table, place, from + 2));
}

// Columns [from, from + 4) of a table as a unit quaternion, interpolated.
function turnAt(table, place, from, out) {
    return out.set(valueAt(table, place, from), valueAt(table, place, from + 1),
        valueAt(table, place, from + 2), valueAt(table, place, from + 3)).normalize();
}

// Norms of the vectors in a table of n rows with m vectors each, n m of them.
function norms(table) {
    const sizes = new Float32Array(table.values.length / 3);
    for (let i = 0; i < sizes.length; i++) {
        sizes[i] = Math.hypot(table.values[3 * i], table.values[3 * i + 1], table.values[3 * i + 2]);
    }
    return sizes;
}

// The largest round number (1, 2, 5, 10, ...) that is no larger than x.
function nice(x) {
    const power = 10 ** Math.floor(Math.log10(x));
    return power * [5, 2, 1].find(step => step * power <= x * 1.0001);
}
