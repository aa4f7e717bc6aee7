// `numbers` writes numbers as people do: four significant digits, a true minus sign, powers of ten
// as 1.2×10⁻⁵, and 0 for what is rounding beside the scale of the motion.

const numbers = (() => {
  const DIGITS = 4;
  const ROUNDING = 1e-12; // times the scale: smaller values are 0
  const [SMALL, LARGE] = [-3, 5]; // powers of ten that are not written
  const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  const NONE = "–";

  const raised = (exponent) => Array.from(`${exponent}`, (c) => RAISED[c] ?? c).join("");
  const power = (exponent) => `10${raised(exponent)}`;
  const minus = (text) => text.replace("-", "−");
  const exponentOf = (value) => Number(Math.abs(value).toExponential(DIGITS - 1).split("e")[1]);
  const isPlain = (exponent) => exponent >= SMALL && exponent < LARGE;

  // A unit as it is printed: m^2 becomes m²; no unit is an empty text.
  function unit(text) {
    if (!text || text === "1" || text === "-") return "";
    return text.replace(/\^?\*?\*?(?<=[A-Za-z^*])(-?\d+)(?![\d.])/g, (_, n) => raised(n)).replace(/[* ]/g, "\u00a0");
  }

  function withUnit(text, of) {
    const printed = unit(of);
    return printed ? `${text}\u00a0${printed}` : text;
  }

  const isRounding = (value, scale) => Math.abs(value) <= ROUNDING * (scale > 0 && scale < Infinity ? scale : 0);

  // Number and unit with four significant digits. `scale` is a typical size of the quantity.
  function text(value, of = "", scale = 0) {
    if (value === null || value === undefined || Number.isNaN(value)) return NONE;
    if (!Number.isFinite(value)) return withUnit(value > 0 ? "∞" : "−∞", of);
    if (value === 0 || isRounding(value, scale)) return withUnit("0", of);
    const exponent = exponentOf(value);
    if (!isPlain(exponent)) {
      const [digits] = value.toExponential(DIGITS - 1).split("e");
      return withUnit(`${minus(digits)}×${power(exponent)}`, of);
    }
    return withUnit(minus(value.toFixed(Math.max(0, DIGITS - 1 - exponent))), of);
  }

  // As `text`, but always with the decimals that suit the scale: for values that change all the time.
  function steady(value, of = "", scale = 1) {
    if (!Number.isFinite(value) || !(scale > 0 && scale < Infinity)) return text(value, of, scale);
    if (!isPlain(exponentOf(scale)) || Math.abs(value) >= 100 * scale) return text(value, of, scale);
    const decimals = Math.max(0, DIGITS - 1 - exponentOf(scale));
    const shown = value.toFixed(decimals);
    return withUnit(Number(shown) === 0 ? (0).toFixed(decimals) : minus(shown), of);
  }

  // Without trailing zeros: for values that are set by hand.
  function short(value, of = "") {
    const [number, ...rest] = text(value).split("×");
    const plain = number.includes(".") ? number.replace(/\.?0+$/, "") : number;
    return withUnit([plain, ...rest].join("×"), of);
  }

  // Texts of the marks of an axis `step` apart; all are in units of 10^exponent.
  function ticks(values, step) {
    const largest = values.reduce((most, v) => Math.max(most, Math.abs(v)), 0);
    const exponent = largest === 0 || isPlain(exponentOf(largest)) ? 0 : exponentOf(largest);
    const apart = step * 10 ** -exponent;
    let decimals = 0;
    while (decimals < 12 && Math.abs(apart - Number(apart.toFixed(decimals))) > 1e-6 * apart) decimals += 1;
    const texts = values.map((v) => {
      const shown = (v * 10 ** -exponent).toFixed(decimals);
      return Number(shown) === 0 ? (0).toFixed(decimals) : minus(shown);
    });
    return { texts, exponent };
  }

  // The unit of an axis whose marks are in units of 10^exponent.
  const axisUnit = (of, exponent) => [exponent ? power(exponent) : "", unit(of)].filter(Boolean).join("\u00a0");

  return { text, steady, short, ticks, unit, axisUnit, isRounding };
})();
