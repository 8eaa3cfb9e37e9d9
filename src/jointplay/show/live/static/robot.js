// The machine in motion, by the player's `Case`, whose tracks are replaced after each run.

const LOOKS = {light: [[0.93, 0.95, 0.97], [0.78, 0.82, 0.86]], dark: [[0.16, 0.19, 0.22], [0.09, 0.11, 0.13]]};
const SEEN_PART = 0.06;  // least size of the magnified largest deviation, relative to the robot's reach

class RobotView {
    constructor(pane, bodies, block) {
        this.viewer = new MeshCat.Viewer(pane);
        const {viewer} = this, resize = viewer.set_3d_pane_size.bind(viewer);
        viewer.set_3d_pane_size = () => { if (pane.clientWidth) resize(pane.clientWidth, pane.clientHeight); };
        viewer.gui.domElement.remove();
        viewer.renderer.domElement.setAttribute("aria-hidden", "true");
        for (const name of ["Axes", "Grid"]) viewer.set_property([name], "visible", false);
        new ResizeObserver(() => { viewer.set_3d_pane_size(); if (!this.turned) this.aim(); }).observe(pane);
        viewer.controls.addEventListener("start", () => { this.turned = true; });  // by the user
        this.bodies = bodies;
        this.surfaces = bodies.surfaces.map(entry => surfaceOf(block, entry));
        this.shown = null;
        this.t = 0;
    }

    theme(dark) {
        const [top, bottom] = LOOKS[dark ? "dark" : "light"];
        this.viewer.set_property(["Background"], "top_color", top);
        this.viewer.set_property(["Background"], "bottom_color", bottom);
        this.viewer.set_dirty();
    }

    // Show a run; returns the factor by which deviations are magnified.
    show(block, entry, colour, factor) {
        entry = {...entry, objects: this.bodies.objects, reach: this.bodies.reach, colour};
        const {reach} = this.bodies;
        if (!this.shown) this.shown = new Case(this.viewer, block, entry, 0, this.surfaces);
        else {
            for (const {line} of this.shown.traces.lines) line.geometry.dispose();
            this.shown.take(block, entry);  // new tracks for the same bodies
        }
        const largest = this.shown.largestDeviation();
        this.automatic = largest ? Math.min(1e5, nice(SEEN_PART * reach / largest) || 1) : 1;
        const typical = Math.max(1e-9, ...entry.joints.map(joint => joint.typical));
        this.view = {
            deviation: factor || Math.max(1, this.automatic), forceFactor: 1, metresPerNewton: nice(0.25 * reach / typical),
            longest: 0.6 * reach, thickness: 0.005 * reach, ring: 0.075 * reach,
        };
        this.shown.moveTo(new THREE.Vector3());
        this.shown.drawTraces(this.view.deviation);
        if (!this.box) this.aim();
        this.seek(this.t);
        return this.view.deviation;
    }

    magnify(factor) {
        if (!this.shown) return 1;
        this.view.deviation = factor || Math.max(1, this.automatic);
        this.shown.drawTraces(this.view.deviation);
        this.seek(this.t);
        return this.view.deviation;
    }

    // Aim the camera so that the whole motion fits into the pane.
    aim() {
        const {viewer, shown} = this, {t} = this;
        if (!shown) return;
        if (!this.box) {
            this.box = new THREE.Box3();
            for (let i = 0; i <= 12; i++) {
                this.seek(shown.entry.start + i / 12 * (shown.entry.end - shown.entry.start));
                viewer.scene.updateMatrixWorld(true);
                for (const {node, twin} of shown.bodies) if (twin) this.box.expandByObject(node);
            }
            this.seek(t);
        }
        if (this.box.isEmpty()) return;
        const size = this.box.getSize(new THREE.Vector3()), centre = this.box.getCenter(new THREE.Vector3());
        const {camera, controls} = viewer;  // whose axes have y up, like those of the box
        camera.near = this.bodies.reach / 200;
        camera.far = this.bodies.reach * 500;
        camera.fov = 32;
        const pane = viewer.renderer.domElement, aspect = Math.min(1, pane.clientWidth / Math.max(pane.clientHeight, 1));
        const distance = 0.52 * size.length() / Math.tan(16 * Math.PI / 180) / Math.max(aspect, 0.1);
        camera.position.copy(new THREE.Vector3(-0.35, 0.5, 1).normalize().multiplyScalar(distance).add(centre));
        controls.target.copy(centre);
        camera.updateProjectionMatrix();
        controls.update();
        viewer.set_dirty();
    }

    seek(t) {
        this.t = t;
        if (!this.shown) return;
        const at = Math.min(Math.max(t, this.shown.entry.start), this.shown.entry.end);
        this.shown.update(at, at, this.view);
        this.viewer.set_dirty();
    }
}
