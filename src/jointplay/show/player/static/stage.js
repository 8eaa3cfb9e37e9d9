// Robots as three.js objects: bodies, ideal twins, traces, rings at joints, forces, static error sets.

// pages.py defines MODES: names and colours of a joint's modes.

const FORCE = 0xd9820a;
const GHOST = 0x00897b;
const FRICTION = 0x2e7d32;
const ERROR = 0x7b1fa2;
const MOST_EDGES = 2500;  // most triangles of a twin's surface that is outlined: finer ones would be all lines

const CREASE = Math.cos(35 * Math.PI / 180);  // triangles whose normals differ by more meet in an edge

// A packed surface as a geometry, shaded smoothly but for its edges: a corner's normal is the mean, weighted
// by area, of those of the triangles around it that are within the crease angle.
function surfaceOf(block, entry) {
    const points = unpack(block, entry.points).values, corners = unpackMesh(block, entry.triangles);
    const faces = corners.length / 3, whole = new Float32Array(corners.length), unit = new Float32Array(corners.length);
    const from = new THREE.Vector3(), a = new THREE.Vector3(), b = new THREE.Vector3();
    const around = new Uint32Array(points.length / 3 + 1);
    for (let f = 0; f < faces; f++) {
        from.fromArray(points, 3 * corners[3 * f]);
        a.fromArray(points, 3 * corners[3 * f + 1]).sub(from);
        b.fromArray(points, 3 * corners[3 * f + 2]).sub(from);
        a.cross(b).toArray(whole, 3 * f);
        a.normalize().toArray(unit, 3 * f);
        for (let c = 0; c < 3; c++) around[corners[3 * f + c] + 1]++;
    }
    for (let i = 1; i < around.length; i++) around[i] += around[i - 1];
    const next = around.slice(), touching = new Uint32Array(corners.length);
    for (let i = 0; i < corners.length; i++) touching[next[corners[i]]++] = Math.floor(i / 3);
    // Corners with the same point and normal share a vertex, so that the graphics card computes it once.
    const positions = [], normals = [], index = new Uint32Array(corners.length);
    const latest = new Int32Array(points.length / 3).fill(-1), earlier = [];  // vertices at each point
    for (let i = 0; i < corners.length; i++) {
        const own = 3 * Math.floor(i / 3), at = corners[i];
        let x = 0, y = 0, z = 0;
        for (let k = around[at]; k < around[at + 1]; k++) {
            const g = 3 * touching[k];
            if (unit[own] * unit[g] + unit[own + 1] * unit[g + 1] + unit[own + 2] * unit[g + 2] < CREASE) continue;
            x += whole[g]; y += whole[g + 1]; z += whole[g + 2];
        }
        a.set(x, y, z).normalize();
        let vertex = latest[at];
        while (vertex >= 0 && (normals[3 * vertex] !== a.x || normals[3 * vertex + 1] !== a.y || normals[3 * vertex + 2] !== a.z))
            vertex = earlier[vertex];
        if (vertex < 0) {
            vertex = earlier.length;
            earlier.push(latest[at]);
            latest[at] = vertex;
            normals.push(a.x, a.y, a.z);
            positions.push(points[3 * at], points[3 * at + 1], points[3 * at + 2]);
        }
        index[i] = vertex;
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(normals, 3));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    return geometry;
}

function nodeAt(viewer, path) {
    const node = viewer.scene_tree.find(path).object;
    node.matrixAutoUpdate = false;
    return node;
}

// A mesh that is solid where it is visible, and shines through faintly where something hides it.
function seenThrough(geometry, colour) {
    const solid = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({color: colour}));
    const faint = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(
        {color: colour, transparent: true, opacity: 0.3, depthTest: false, depthWrite: false}));
    faint.renderOrder = 10;
    solid.add(faint);
    return solid;
}

function paint(mesh, colour) {
    mesh.traverse(part => { if (part.material) part.material.color.setHex(colour); });
}

// An arrow along +z of length 1, with a second head, for `aimArrow` to scale.
function makeArrow(colour) {
    const arrow = new THREE.Group();
    const head = new THREE.ConeGeometry(2.6, 1, 16).rotateX(Math.PI / 2);
    arrow.add(seenThrough(new THREE.CylinderGeometry(1, 1, 1, 12).rotateX(Math.PI / 2), colour),
        seenThrough(head, colour), seenThrough(head, colour));
    arrow.visible = false;
    return arrow;
}

// Aim an arrow from `tail` along `force`, `wanted` long. One longer than `most` is cut to that, and has a
// second head to say so.
const UP = new THREE.Vector3(0, 0, 1);
function aimArrow(arrow, tail, force, wanted, most, thickness) {
    arrow.visible = wanted > 0.5 * thickness;
    if (!arrow.visible) return;
    const length = Math.min(wanted, most);
    const [shaft, head, second] = arrow.children;
    const tip = Math.min(7 * thickness, 0.6 * length);
    head.scale.set(thickness, thickness, tip);
    head.position.z = length - tip / 2;
    second.visible = wanted > most;
    second.scale.copy(head.scale);
    second.position.z = length - 1.6 * tip;
    shaft.scale.set(thickness, thickness, length - tip);
    shaft.position.z = (length - tip) / 2;
    arrow.position.copy(tail);
    arrow.quaternion.setFromUnitVectors(UP, force.clone().normalize());
}

// A body of the ideal twin: translucent, outlined.
function ghostOf(object) {
    const twin = object.clone();
    const triangles = (twin.geometry.index || twin.geometry.attributes.position).count / 3;
    twin.material = new THREE.MeshLambertMaterial({
        color: GHOST, transparent: true, opacity: 0.16, depthWrite: false,
        polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    });
    twin.castShadow = twin.receiveShadow = false;
    if (triangles <= MOST_EDGES) {
        const edges = new THREE.EdgesGeometry(twin.geometry, 30);
        twin.add(new THREE.LineSegments(edges, new THREE.LineBasicMaterial({color: GHOST})));
    }
    return twin;
}

// A case: its tracks, and the objects that they move.
class Case {
    constructor(viewer, block, entry, index, surfaces) {
        Object.assign(this, {viewer, index, label: entry.label, visible: true});
        this.group = nodeAt(viewer, ["meshcat", `case${index}`]);
        this.matrices = entry.links.map(() => new THREE.Matrix4());
        this.idealMatrices = entry.links.map(() => new THREE.Matrix4());
        this.take(block, entry);
        this.bodies = this.makeBodies(surfaces);
        if (entry.error) this.makeError(item => unpack(block, item));
    }

    // Take tracks, and make the objects that belong to them. The live page does so for each new run.
    take(block, entry) {
        Object.assign(this, {block, entry});
        const table = item => unpack(block, item);
        this.time = unpack(block, entry.time, Float64Array).values;
        this.real = {position: table(entry.poses.position), turn: table(entry.poses.turn)};
        this.tool = table(entry.tool);
        if (entry.ghost) {
            this.ideal = {position: table(entry.ghost.position), turn: table(entry.ghost.turn)};
            this.idealTool = table(entry.ghost.tool);
        }
        this.traces = this.makeTraces();
        this.joints = entry.joints.map(joint => this.makeJoint(joint, table));
    }

    // Bodies and their twins: node, number of the link, placement on it, whether it is a twin's.
    makeBodies(surfaces) {
        const {viewer, entry} = this, own = `case${this.index}`;
        const bodies = [];
        entry.objects.forEach(({link, surface, colour, opacity, matrix}, k) => {
            const body = new THREE.Mesh(surfaces[surface], new THREE.MeshPhongMaterial({
                color: colour, opacity, transparent: opacity < 1, side: THREE.DoubleSide, shininess: 20, specular: 0x222222,
            }));
            body.castShadow = body.receiveShadow = true;
            const path = ["meshcat", own, "visuals", String(k)];
            viewer.set_object(path, body);
            const at = entry.links.indexOf(link), fixed = new THREE.Matrix4().fromArray(matrix);
            bodies.push({node: nodeAt(viewer, path), at, fixed, twin: false});
            if (this.ideal) {
                const twin = ["meshcat", own, "ghost", String(k)];
                viewer.set_object(twin, ghostOf(body));
                bodies.push({node: nodeAt(viewer, twin), at, fixed, twin: true});
            }
        });
        return bodies;
    }

    // The tool's static error set: an ellipsoid about the ideal tool, a unit sphere that is stretched.
    makeError(table) {
        this.error = {time: unpack(this.block, this.entry.error.time, Float64Array).values, set: table(this.entry.error.set)};
        const set = new THREE.Group();
        const skin = new THREE.Mesh(new THREE.SphereGeometry(1, 48, 32), new THREE.MeshLambertMaterial(
            {color: ERROR, transparent: true, opacity: 0.25, depthTest: false, depthWrite: false}));
        skin.renderOrder = 9;  // after the bodies, through which it stays visible
        set.add(skin);
        for (const [a, b] of [["x", "y"], ["y", "z"], ["z", "x"]]) {
            const points = Array.from({length: 65}, (_, i) => {
                const point = new THREE.Vector3();
                point[a] = Math.cos(i * Math.PI / 32);
                point[b] = Math.sin(i * Math.PI / 32);
                return point;
            });
            const ring = new THREE.Line(new THREE.BufferGeometry().setFromPoints(points),
                new THREE.LineBasicMaterial({color: ERROR, transparent: true, opacity: 0.8, depthTest: false}));
            ring.renderOrder = 9;
            set.add(ring);
        }
        const path = ["meshcat", `case${this.index}`, "error"];
        this.viewer.set_object(path, set);
        this.error.node = nodeAt(this.viewer, path);
    }

    // The static error set at time t: six entries of its matrix, worst case and RMS [m].
    errorAt(t) {
        const {time, set} = this.error, place = between(time, t);
        return Array.from({length: set.columns}, (_, k) => valueAt(set, place, k));
    }

    updateError(t, view) {
        const [xx, xy, xz, yy, yz, zz, worst, rms] = this.errorAt(t), k = view.deviation;
        const c = vectorAt(this.idealTool, this.place, 0, Case.vector);
        this.error.node.matrix.set(k * xx, k * xy, k * xz, c.x, k * xy, k * yy, k * yz, c.y,
            k * xz, k * yz, k * zz, c.z, 0, 0, 0, 1);
        this.error.node.matrixWorldNeedsUpdate = true;
        Object.assign(this.error, {worst, rms});
    }

    makeTraces() {
        const most = 6000, rows = this.time.length, step = Math.ceil(rows / most);
        const picked = [];
        for (let row = 0; row < rows; row += step) picked.push(row);
        if (picked[picked.length - 1] !== rows - 1) picked.push(rows - 1);
        const lines = [];
        const add = (name, colour, opacity) => {
            const geometry = new THREE.BufferGeometry();
            geometry.setAttribute("position",
                new THREE.BufferAttribute(new Float32Array(3 * picked.length), 3));
            const line = new THREE.Line(geometry,
                new THREE.LineBasicMaterial({color: colour, transparent: true, opacity}));
            line.frustumCulled = false;
            this.viewer.set_object(["meshcat", `case${this.index}`, "trace", name], line);
            lines.push({name, line});
            return line;
        };
        const colour = this.entry.colour;
        if (this.ideal) add("ideal", GHOST, 0.8);
        add("whole", colour, 0.35);
        add("travelled", colour, 1.0);
        return {picked, lines};
    }

    // Draw the tool's paths, with deviations from the ideal twin magnified.
    drawTraces(deviation) {
        for (const {name, line} of this.traces.lines) {
            const positions = line.geometry.attributes.position;
            this.traces.picked.forEach((row, i) => {
                for (let k = 0; k < 3; k++) {
                    const at = 3 * row + k;
                    const ideal = this.ideal ? this.idealTool.values[at] : this.tool.values[at];
                    const away = name === "ideal" ? 0 : this.tool.values[at] - ideal;
                    positions.array[3 * i + k] = ideal + deviation * away;
                }
            });
            positions.needsUpdate = true;
        }
    }

    // Distance of the tool from the twin's tool in a record, m.
    deviationAt(row) {
        const real = this.tool.values, ideal = this.idealTool.values, at = 3 * row;
        return Math.hypot(real[at] - ideal[at], real[at + 1] - ideal[at + 1], real[at + 2] - ideal[at + 2]);
    }

    // Record of the largest deviation.
    worstRow() {
        let worst = 0, largest = 0;
        for (let row = 0; row < this.time.length; row++) {
            const deviation = this.deviationAt(row);
            if (deviation > largest) { largest = deviation; worst = row; }
        }
        return worst;
    }

    largestDeviation() { return this.deviationAt(this.worstRow()); }

    makeJoint(entry, table) {
        const joint = {entry, name: entry.name, placement: new THREE.Matrix4().fromArray(entry.placement)};
        for (const name of ["force", "mode", "tilt_angle", "turn", "slide", "displacement", "tilt",
            "place", "shift", "normal", "friction"]) joint[name] = table(entry[name]);
        if (entry.elements) {
            joint.cage = table(entry.elements.cage);
            joint.loads = table(entry.elements.loads);
        }
        joint.size = norms(joint.force);
        joint.pressing = norms(joint.normal);
        const ring = seenThrough(new THREE.TorusGeometry(1, 0.1, 12, 48), MODES[0].colour);
        const path = ["meshcat", `case${this.index}`, "joints", entry.name];
        this.viewer.set_object([...path, "mode"], ring);
        joint.ringNode = nodeAt(this.viewer, [...path, "mode"]);
        ring.visible = entry.marked;  // hinges of flexible links are not marked
        joint.ring = ring;
        joint.arrow = makeArrow(FORCE);
        this.viewer.set_object([...path, "force"], joint.arrow);
        return joint;
    }

    // Move everything to time t. Forces are the largest since the time `held`.
    update(t, held, view) {
        const place = between(this.time, t);
        this.place = place;
        const {matrices, idealMatrices, entry} = this;
        const p = Case.vector, g = Case.other, q = Case.turn, h = Case.otherTurn;
        for (let link = 0; link < entry.links.length; link++) {
            vectorAt(this.real.position, place, 3 * link, p);
            turnAt(this.real.turn, place, 4 * link, q);
            if (this.ideal) {
                vectorAt(this.ideal.position, place, 3 * link, g);
                turnAt(this.ideal.turn, place, 4 * link, h);
                idealMatrices[link].compose(g, h, Case.one);
            }
            matrices[link].compose(p, q, Case.one);
            // The displacement of every point is magnified (matrices are extrapolated), so that bodies
            // stay connected at joints; they are sheared a little.
            if (this.ideal && view.deviation !== 1) {
                const real = matrices[link].elements, ideal = idealMatrices[link].elements;
                for (let k = 0; k < 16; k++) real[k] = ideal[k] + view.deviation * (real[k] - ideal[k]);
            }
        }
        for (const {node, at, fixed, twin} of this.bodies) {
            node.matrix.multiplyMatrices((twin ? idealMatrices : matrices)[at], fixed);
            node.matrixWorldNeedsUpdate = true;
        }
        for (const {name, line} of this.traces.lines) {
            if (name !== "travelled") continue;
            let low = 0;
            while (low < this.traces.picked.length && this.traces.picked[low] <= place.a) low++;
            line.geometry.setDrawRange(0, low);
        }
        if (this.error) this.updateError(t, view);
        for (const joint of this.joints) this.updateJoint(joint, t, held, view);
    }

    updateJoint(joint, t, held, view) {
        const from = rowAt(this.time, held), to = this.place.b;
        let top = to;
        for (let row = from; row < to; row++) if (joint.size[row] > joint.size[top]) top = row;
        // A peak may have come and gone between two records: its mode was contact, not the recorded one.
        const mode = joint.size[top] > 0 ? joint.mode.values[top] || 2 : joint.mode.values[to];
        Object.assign(joint, {from, to, top, modeNow: mode, force_N: joint.size[top]});
        const matrix = joint.ringNode.matrix;
        matrix.multiplyMatrices(this.matrices[joint.entry.carrier], joint.placement);
        joint.ringNode.matrixWorldNeedsUpdate = true;
        joint.ring.scale.setScalar(view.ring);
        paint(joint.ring, MODES[joint.modeNow].colour);
        const force = Case.vector.fromArray(joint.force.values, 3 * top);
        const wanted = joint.size[top] * view.metresPerNewton * view.forceFactor;
        aimArrow(joint.arrow, Case.other.setFromMatrixPosition(matrix), force,
            wanted, view.longest, view.thickness);
    }

    show(visible) {
        this.visible = visible;
        this.group.visible = visible;
    }

    moveTo(offset) {
        this.offset = offset;
        this.group.matrix.makeTranslation(offset.x, offset.y, offset.z);
        this.group.matrixWorldNeedsUpdate = true;
    }
}
Case.vector = new THREE.Vector3();
Case.other = new THREE.Vector3();
Case.turn = new THREE.Quaternion();
Case.otherTurn = new THREE.Quaternion();
Case.one = new THREE.Vector3(1, 1, 1);
