/** Show the page that the address names, and tidy up the one before. */

import { announce } from "./announce.js";
import { h, replace } from "./dom.js";
import { installLogout, showLogout } from "./logout.js";
import { loginPage } from "./pages/login.js";
import { failure } from "./parts/failure.js";
import { place } from "./router.js";
import { installThemeToggle } from "./theme-toggle.js";

const main = document.getElementById("main");
const logout = document.getElementById("logout");
let leaving = new AbortController();
let shownPath = null;

async function navigate() {
  if (location.hash === "#main") return;
  leaving.abort();
  leaving = new AbortController();
  const { signal } = leaving;
  const at = place(location.hash);
  for (const anchor of document.querySelectorAll("nav [data-section]")) {
    if (anchor.dataset.section === at?.section) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
  try {
    if (at === null) throw new Error("There is no such page.");
    const { show } = await at.load();
    const page = await show(at, signal);
    if (signal.aborted) return;
    present(at.path, page.title, page.element);
  } catch (error) {
    if (signal.aborted) return;
    if (error.status === 401) {
      const login = loginPage(() => Promise.all([navigate(), showLogout(logout)]));
      present(at?.path, login.title, login.element);
      return;
    }
    present(at?.path, "Not shown", h("div", { class: "page" }, h("h1", {}, "This cannot be shown"), failure(error)));
  }
}

function present(path, title, element) {
  document.title = `${title} · Armature`;
  replace(main, element);
  if (shownPath !== null && shownPath !== path) {
    scrollTo(0, 0);
    main.focus({ preventScroll: true });
    announce(title);
  }
  shownPath = path;
}

installThemeToggle(document.getElementById("theme"));
installLogout(logout, navigate);
document.getElementById("skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
addEventListener("hashchange", navigate);
navigate();
