// Messages to the studio. The address of the page holds the token, so every request is relative to it.

async function answer(response) {
  const text = await response.text();
  let value;
  try { value = JSON.parse(text); } catch { value = { error: text }; }
  if (!response.ok) throw new Error(value.error || `the studio answered ${response.status}`);
  return value;
}

async function send(address, options) {
  let response;
  try {
    response = await fetch(address, options);
  } catch {
    throw new Error("The studio does not answer. Is `stylet studio` still running in the terminal?");
  }
  return answer(response);
}

export function call(name, body = {}) {
  return send(`api/${name}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
}

export function upload(file) {
  return send(`upload/${encodeURIComponent(file.name)}`, { method: "POST", body: file });
}

// Does one piece of work at a time, in order. A request that `replaceable` accepts gives way to the next one.
export function inOrder(work, replaceable = () => true) {
  const waiting = [];
  let busy = false;
  return async function request(value) {
    if (waiting.length && replaceable(waiting.at(-1))) waiting.pop();
    waiting.push(value);
    if (busy) return;
    busy = true;
    while (waiting.length) await work(waiting.shift());
    busy = false;
  };
}
