// `makePicker` asks for channels: a dialog with a field to search in and a list to choose from.

// An element of the plots, with a class and a text.
const plotElement = (tag, className, text) => {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text !== undefined) element.textContent = text;
  return element;
};

const makePicker = (host, channels) => {
  const make = plotElement;
  const dialog = host.appendChild(make("dialog", "picker"));
  const title = dialog.appendChild(make("h2"));
  const search = dialog.appendChild(make("input"));
  const list = dialog.appendChild(make("div", "picker-list"));
  const foot = dialog.appendChild(make("p", "picker-foot"));
  const note = foot.appendChild(make("span"));
  const done = foot.appendChild(make("button", "", "Done"));
  const id = `picker-${Math.random().toString(36).slice(2)}`;
  done.type = "button";
  title.id = `${id}-title`;
  list.id = `${id}-list`;
  dialog.setAttribute("aria-labelledby", title.id);
  Object.assign(search, { type: "search", placeholder: "Search: a name, force, speed, energy", autocomplete: "off", spellcheck: false });
  for (const [name, value] of Object.entries({
    role: "combobox", "aria-expanded": "true", "aria-controls": list.id, "aria-autocomplete": "list", "aria-label": "Search",
  })) search.setAttribute(name, value);
  list.setAttribute("role", "listbox");
  list.tabIndex = -1;

  let options = []; // {key, element} that are shown
  let active = -1;
  let asked = null; // {isChosen, choose, many, extra}

  const words = (text) => text.toLowerCase().split(/[\s.:_]+/).filter(Boolean);
  function fits(channel, wanted) {
    const text = `${channel.label} ${channel.key} ${channel.group} ${channel.unit}`.toLowerCase();
    return wanted.every((word) => text.includes(word));
  }

  function put(parent, key, label, unit) {
    const element = parent.appendChild(make("div", "picker-option"));
    element.id = `${id}-${options.length}`;
    element.setAttribute("role", "option");
    element.append(make("span", "picker-label", label), make("span", "picker-unit", numbers.unit(unit)));
    const number = options.length;
    element.addEventListener("click", () => { activate(number); choose(); });
    options.push({ key, element });
  }

  function fill() {
    const wanted = words(search.value);
    options = [];
    list.replaceChildren();
    if (asked.extra && !wanted.length) put(list, asked.extra.key, asked.extra.label, "s");
    const groups = new Map();
    for (const channel of channels.list) {
      if (!fits(channel, wanted)) continue;
      if (!groups.has(channel.group)) {
        const group = list.appendChild(make("div", "picker-group"));
        const head = group.appendChild(make("div", "picker-head", channel.group));
        head.id = `${id}-group-${groups.size}`;
        group.setAttribute("role", "group");
        group.setAttribute("aria-labelledby", head.id);
        groups.set(channel.group, group);
      }
      put(groups.get(channel.group), channel.key, channel.label, channel.unit);
    }
    note.textContent = options.length ? `${options.length} of ${channels.list.length}` : "Nothing has this name.";
    mark();
    activate(options.length ? 0 : -1);
  }

  function mark() {
    for (const { key, element } of options) element.setAttribute("aria-selected", `${asked.isChosen(key)}`);
  }

  function activate(number) {
    options[active]?.element.classList.remove("active");
    active = number;
    const option = options[active]?.element;
    option?.classList.add("active");
    option?.scrollIntoView({ block: "nearest" });
    search.setAttribute("aria-activedescendant", option?.id ?? "");
  }

  function choose() {
    if (!options[active]) return;
    asked.choose(options[active].key);
    if (!asked.many) dialog.close();
    else mark();
  }

  const moves = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10 };
  dialog.addEventListener("keydown", (event) => {
    event.stopPropagation(); // the page has keys of its own
    if (event.key === "Escape") dialog.close(); // a search field takes it to empty itself
    else if (event.target === done) return;
    else if (event.key in moves && options.length) {
      activate(Math.min(Math.max(active + moves[event.key], 0), options.length - 1));
    } else if (event.key === "Enter") choose();
    else return;
    event.preventDefault();
  });
  search.addEventListener("input", fill);
  done.addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });

  // Ask: isChosen(key), choose(key); `many` for more than one; `extra` {key, label} comes first.
  return {
    open(heading, question) {
      asked = question;
      title.textContent = heading;
      list.setAttribute("aria-multiselectable", `${Boolean(asked.many)}`);
      done.textContent = asked.many ? "Done" : "Cancel";
      search.value = "";
      dialog.showModal();
      fill();
      search.focus();
    },
  };
};
