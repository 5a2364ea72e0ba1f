// The key of the page's server: in the fragment of the address that the terminal shows, then in the storage of this tab,
// which belongs to this port. A cookie would be sent to the servers of other users on other ports.

const KEY = "armwright-key";
const WHERE = "open the address that the terminal shows, with all that follows the #";

// Moves a key from the address, where history and bookmarks would keep it, to the tab.
function takeKey() {
  const query = new URLSearchParams(location.hash.slice(1)), given = query.get("key");
  if (given === null) return false;
  sessionStorage.setItem(KEY, given);
  query.delete("key");
  history.replaceState(null, "", `${location.pathname}#${query}`.replace(/#$/, ""));
  return true;
}

export function openKey() {
  takeKey();
  addEventListener("hashchange", () => { // an address with another key was opened in this tab
    if (takeKey()) location.reload();
  });
  if (sessionStorage.getItem(KEY) === null) throw new Error(`this tab has no key; ${WHERE}`);
}

// Asks the server; an error has the status of a refusal.
export async function request(path, options = {}) {
  const key = encodeURIComponent(sessionStorage.getItem(KEY)); // as it is, unless it is none of ours
  const reply = await fetch(path, { ...options, headers: { ...options.headers, "x-armwright-key": key } });
  if (reply.ok) return reply;
  const text = reply.status === 403 ? `this tab has the key of another server, such as an earlier one; ${WHERE}` : await reply.text();
  throw Object.assign(new Error(text), { status: reply.status });
}

export const post = (path, content) =>
  request(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(content) });
