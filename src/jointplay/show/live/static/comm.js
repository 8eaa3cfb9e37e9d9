// Questions over the comm of a notebook's widget, and the module that the notebook loads.

function overComm(model) {
    let number = 0;
    const receivers = new Map();
    model.on("msg:custom", (head, buffers) => {
        const receive = receivers.get(head.to);
        if (!receive) return;
        const view = buffers[0];
        receive(head, view ? new Uint8Array(view.buffer, view.byteOffset, view.byteLength) : new Uint8Array(0));
        if (head.kind === "end" || head.kind === "scenario") receivers.delete(head.to);
    });
    const post = (what, values, receive) => {
        const to = ++number;
        receivers.set(to, receive);
        model.send({what, to, values});
        return () => receivers.delete(to);
    };
    return {
        linked: false,
        ask: (values, receive) => post("ask", values, receive),
        scenario: values => new Promise((give, refuse) => post("scenario", values,
            head => head.error ? refuse(new Error(head.error)) : give(head.text))),
    };
}

export default {
    render({model, el}) {
        const root = document.createElement("div"), bytes = model.get("block");
        el.append(root);
        const block = new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength);
        root.live = jointplayLive(MeshCat).mount(root, model.get("contents"), block, overComm(model));
    },
};
