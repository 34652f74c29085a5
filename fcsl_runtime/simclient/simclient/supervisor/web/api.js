// SPDX-License-Identifier: Apache-2.0
// Requests to the supervisor. The token is kept in memory alone: never in a URL, nor in what the browser stores.

let token = "";

export function useToken(text) {
  token = text;
}

/** An answer that is an error, in the words of the supervisor. */
export class Refused extends Error {
  constructor(status, error) {
    super(error.hint ? `${error.message} (${error.hint})` : error.message);
    this.status = status;
  }
}

async function answer(method, path, body, signal) {
  const headers = token ? { Authorization: `Bearer ${token}` } : {};
  if (body !== undefined) headers["Content-Type"] = "application/json";
  const found = await fetch(path, {
    method, headers, signal, body: body === undefined ? undefined : JSON.stringify(body), redirect: "error",
  });
  if (found.ok) return found;
  const text = await found.text();
  let error = { message: `${method} ${path}: status ${found.status}` };
  try {
    error = JSON.parse(text).error ?? error;
  } catch {
    // not an answer of the supervisor
  }
  throw new Refused(found.status, error);
}

export async function ask(method, path, body) {
  return (await answer(method, path, body)).json();
}

/** Name and data of each event of a stream, until it ends. */
export async function* events(path, signal) {
  const found = await answer("GET", path, undefined, signal);
  const reader = found.body.pipeThrough(new TextDecoderStream()).getReader();
  let held = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const parts = (held + value).split("\n\n");
    held = parts.pop();
    for (const part of parts) {
      const [, name, data] = /^event: (\w+)\ndata: (.*)$/.exec(part);
      yield [name, JSON.parse(data)];
    }
  }
}
