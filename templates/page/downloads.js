// `downloads` gives texts and pictures to the reader as files, and writes tables as `eomgen simulate` does.

const downloads = (() => {
  function save(name, blob) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // A double as Python writes it: the fewest digits that read back exactly.
  function decimal(value) {
    if (Number.isNaN(value)) return "nan";
    if (!Number.isFinite(value)) return value > 0 ? "inf" : "-inf";
    const sign = value < 0 || Object.is(value, -0) ? "-" : "";
    const [mantissa, after] = Math.abs(value).toExponential().split("e");
    const [digits, exponent] = [mantissa.replace(".", ""), Number(after)];
    if (exponent < -4 || exponent >= 16) {
      const size = `${Math.abs(exponent)}`.padStart(2, "0");
      return `${sign}${mantissa}e${exponent < 0 ? "-" : "+"}${size}`;
    }
    if (exponent < 0) return `${sign}0.${"0".repeat(-exponent - 1)}${digits}`;
    const whole = digits.slice(0, exponent + 1).padEnd(exponent + 1, "0");
    return `${sign}${whole}.${digits.slice(exponent + 1) || "0"}`;
  }

  const cell = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

  // How many rows before each one have its time: 0 but at impacts.
  function struck(t) {
    const counts = [];
    for (let i = 0; i < t.length; i += 1) counts.push(i > 0 && t[i] === t[i - 1] ? counts[i - 1] + 1 : 0);
    return counts;
  }

  // A table of columns {name, values}, after the times and, where times repeat, the column `event`.
  function table(t, columns) {
    const events = struck(t);
    const withEvents = events.some((count) => count > 0);
    const head = ["t", ...(withEvents ? ["event"] : []), ...columns.map((c) => cell(c.name))];
    const lines = [head.join(",")];
    for (let i = 0; i < t.length; i += 1) {
      const line = [decimal(t[i])];
      if (withEvents) line.push(`${events[i]}`);
      for (const { values } of columns) line.push(decimal(values[i]));
      lines.push(line.join(","));
    }
    return `${lines.join("\n")}\n`;
  }

  // A name of a file from any text.
  const fileName = (text) => text.replace(/[^\p{L}\p{N}._-]+/gu, "_").replace(/^[._]+/, "").slice(0, 80) || "run";

  const saveText = (name, text, type = "text/csv") => save(name, new Blob([text], { type }));
  return { save, saveText, decimal, table, fileName };
})();
