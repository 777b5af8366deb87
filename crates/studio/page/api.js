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

// Calls `work` with the newest request only: while one is on its way, later ones replace each other.
export function newestOnly(work) {
  let busy = false, waiting = null;
  return async function request(value) {
    if (busy) { waiting = value; return; }
    busy = true;
    try {
      await work(value);
    } finally {
      busy = false;
      if (waiting !== null) { const next = waiting; waiting = null; request(next); }
    }
  };
}
