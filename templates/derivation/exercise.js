// Answers are read as formulas and compared with the result at many random states. No text is executed.

const FUNCTIONS = { sin: Math.sin, cos: Math.cos, tan: Math.tan, sqrt: Math.sqrt, exp: Math.exp, log: Math.log, abs: Math.abs, Abs: Math.abs };
const STATES = 200;

// A function of values by name; throws a sentence where the text is no formula of the names in `known`.
const formula = (text, known) => {
  const tokens = [];
  const pattern = /\s*(?:(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+)|([A-Za-z_]\w*)|(\*\*|[-+*/^()]))/y;
  const source = text.replace(/[−–]/g, "-").replace(/[⋅·×]/g, "*").trim();
  while (pattern.lastIndex < source.length) {
    const start = pattern.lastIndex;
    const found = pattern.exec(source);
    if (!found) throw new Error(`“${source.slice(start).trim()[0]}” is not understood.`);
    tokens.push({ number: found[1], name: found[2], sign: found[3] === "**" ? "^" : found[3] });
  }
  let at = 0;
  let depth = 0;
  const sign = (...some) => at < tokens.length && some.includes(tokens[at].sign);
  const taken = (some) => {
    if (!sign(some)) throw new Error(`A “${some}” is missing.`);
    at += 1;
  };
  const inside = () => {
    if ((depth += 1) > 100) throw new Error("There are too many brackets.");
    taken("(");
    const value = sum();
    taken(")");
    depth -= 1;
    return value;
  };
  const atom = () => {
    const token = tokens[at];
    if (!token) throw new Error("The formula ends too early.");
    if (token.sign === "(") return inside();
    at += 1;
    if (token.number) return () => Number(token.number);
    if (token.name === "pi") return () => Math.PI;
    if (known.includes(token.name)) return (values) => values[token.name];
    if (!token.name) throw new Error(`“${token.sign}” stands where a value is expected.`);
    if (!Object.hasOwn(FUNCTIONS, token.name)) throw new Error(`“${token.name}” is no symbol here.`);
    const inner = inside();
    return (values) => FUNCTIONS[token.name](inner(values));
  };
  const power = () => {
    const base = atom();
    if (!sign("^")) return base;
    at += 1;
    const exponent = signed();
    return (values) => base(values) ** exponent(values);
  };
  const signed = () => {
    if ((depth += 1) > 100) throw new Error("There are too many signs.");
    const minus = sign("-");
    if (sign("-", "+")) at += 1;
    else {
      depth -= 1;
      return power();
    }
    const value = signed();
    depth -= 1;
    return minus ? (values) => -value(values) : value;
  };
  const product = () => {
    let value = signed();
    for (;;) {
      const left = value;
      const next = tokens[at];
      if (sign("*", "/")) {
        at += 1;
        const right = signed();
        value = next.sign === "*" ? (values) => left(values) * right(values) : (values) => left(values) / right(values);
      } else if (next && (next.number || next.name || next.sign === "(")) {
        const right = power();
        value = (values) => left(values) * right(values);
      } else return value;
    }
  };
  const sum = () => {
    let value = product();
    while (sign("+", "-")) {
      const left = value;
      const minus = sign("-");
      at += 1;
      const right = product();
      value = minus ? (values) => left(values) - right(values) : (values) => left(values) + right(values);
    }
    return value;
  };
  const whole = sum();
  if (at < tokens.length) throw new Error(`“${tokens[at].sign ?? tokens[at].name}” is not expected.`);
  return whole;
};

// A function of values by name, from operations on a stack.
const followed = (program, known) => (values) => {
  const stack = [];
  for (const [kind, what] of program) {
    if (kind === 0) stack.push(what);
    else if (kind === 1) stack.push(values[known[what]]);
    else if (kind === 2) stack.push(stack.splice(-what).reduce((a, b) => a + b));
    else if (kind === 3) stack.push(stack.splice(-what).reduce((a, b) => a * b));
    else if (kind === 4) {
      const [base, exponent] = stack.splice(-2);
      stack.push(base ** exponent);
    } else stack.push(FUNCTIONS[what](stack.pop()));
  }
  return stack[0];
};

// What is said of an answer.
const judged = (text, question, { known, positive }) => {
  const [ours, theirs] = [followed(question.program, known), formula(text, known)];
  if (Object.keys(question.at).length) {
    const [want, found] = [ours(question.at), theirs(question.at)];
    return Math.abs(found - want) <= 0.01 * Math.abs(want);
  }
  const pairs = [];
  for (let i = 0; i < STATES; i += 1) {
    const values = {};
    for (const name of known) values[name] = positive.includes(name) ? 0.5 + 1.5 * Math.random() : 6 * Math.random() - 3;
    const want = ours(values);
    if (Number.isFinite(want)) pairs.push([want, theirs(values)]);
  }
  return pairs.length > STATES / 2 && pairs.every(([a, b]) => Math.abs(a - b) <= 1e-9 * Math.max(1e-3, Math.abs(a)));
};

const data = JSON.parse(document.getElementById("data").textContent);
for (const form of document.querySelectorAll("form[data-question]")) {
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const said = form.querySelector("output");
    try {
      const right = judged(form.querySelector("input").value, data.questions[form.dataset.question], data);
      said.textContent = right ? "Right." : "Not the same.";
    } catch (error) {
      said.textContent = error.message;
    }
  });
}
