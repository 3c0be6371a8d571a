// Asks the server with the token of this session; files go to it and come from it.

const TOKEN_KEY = "axiscal-token";

function token() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem(TOKEN_KEY, given);
    // out of the address line, so that it is in no bookmark and on no screenshot
    history.replaceState(null, "", location.pathname);
  }
  return given ?? sessionStorage.getItem(TOKEN_KEY) ?? "";
}

export const headers = { "x-axiscal-token": token() };

async function fetched(path, options) {
  try {
    return await fetch(path, options);
  } catch {
    throw { messages: [{ message: "the workbench does not answer", help: "is it still running in the terminal?" }] };
  }
}

/** The answer as JSON; a refusal is thrown, with its messages. */
export async function ask(path, body) {
  const options = body === undefined
    ? { headers }
    : { method: "POST", headers: { ...headers, "content-type": "application/json" }, body: JSON.stringify(body) };
  const response = await fetched(path, options);
  const text = await response.text();
  let answer;
  try {
    answer = JSON.parse(text);
  } catch {
    answer = { messages: [{ message: text || `answer ${response.status}` }] };
  }
  // what cannot be tried is an answer as well, with its reason
  if (!response.ok || answer.error) throw { status: response.status, ...answer };
  return answer;
}

/** Saves what the server has at a path as a file of the user's. */
export async function download(path, name) {
  const response = await fetched(path, { headers });
  if (!response.ok) throw { status: response.status, ...(await response.json()) };
  const address = URL.createObjectURL(await response.blob());
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
}

/** A file, or a typed text, as the server takes it. */
export async function upload(file, name = file.name) {
  const data = await new Promise((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result.slice(reader.result.indexOf(",") + 1));
    reader.onerror = () => failed({ messages: [{ message: `${name} cannot be read`, help: "choose it again" }] });
    reader.readAsDataURL(file);
  });
  return { name, data };
}

/** What a refusal says, line by line: place, message, remedy. */
export function lines(error) {
  if (error?.lines?.length) return error.lines;
  const messages = error?.messages ?? [{ message: String(error?.message ?? error) }];
  return messages.flatMap((m) => [`${m.place ? `${m.place}: ` : ""}${m.message}`, ...(m.help ? [`  ${m.help}`] : [])]);
}
