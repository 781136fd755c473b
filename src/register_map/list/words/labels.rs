//! Names of numbers in one cell.

/// `0=off; 1=on`; a semicolon within a name has `\` in front.
pub fn labels_of(cell: &str) -> Option<Vec<(i128, String)>> {
    let mut parts = vec![String::new()];
    let mut signs = cell.chars();
    while let Some(sign) = signs.next() {
        let last = parts.last_mut()?;
        match sign {
            ';' => parts.push(String::new()),
            '\\' => match signs.next()? {
                'n' => last.push('\n'),
                sign => last.push(sign),
            },
            sign => last.push(sign),
        }
    }
    let label = |part: &String| {
        let (number, text) = part.split_once('=')?;
        Some((number.trim().parse().ok()?, text.trim().to_owned()))
    };
    parts.iter().map(label).collect()
}

/// The same as manuals write it: `0=Off, 1=On`, `0: Off / 1: On`, `0 = Off | 1 = On`. Each begins with its number and the first
/// sign behind a number, so that a name keeps its own commas. `None` also where a number has two names.
pub fn written_labels_of(cell: &str) -> Option<Vec<(i128, String)>> {
    if cell.contains('\\') {
        return labels_of(cell);
    }
    let cell = cell.trim();
    let mark = cell[cell.find(['=', ':'])?..].chars().next()?;
    let is_between = |sign: char| sign.is_whitespace() || matches!(sign, ';' | ',' | '/' | '|');
    let number = |text: &str| {
        let hex = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
        hex.map_or_else(|| text.parse::<i128>(), |digits| i128::from_str_radix(digits, 16)).ok()
    };
    // Where a number and its mark begin and end.
    let start = |at: usize| {
        let (word, rest) = cell[at..].split_at(cell[at..].find(|sign| is_between(sign) || sign == mark)?);
        let behind = rest.trim_start().strip_prefix(mark)?;
        Some((at, cell.len() - behind.len(), number(word)?))
    };
    let behind = cell.char_indices().filter(|(_, sign)| is_between(*sign)).map(|(at, sign)| at + sign.len_utf8());
    let starts: Vec<(usize, usize, i128)> = std::iter::once(0).chain(behind).filter_map(start).collect();
    let ends = starts.iter().skip(1).map(|(at, ..)| *at).chain([cell.len()]);
    let label = |((_, from, number), to): (&(usize, usize, i128), usize)| {
        (*number, cell[*from..to].trim_matches(is_between).to_owned())
    };
    let labels: Vec<(i128, String)> = starts.iter().zip(ends).map(label).collect();
    let is_known = |(n, (number, text)): (usize, &(i128, String))| {
        !text.is_empty() && !labels[..n].iter().any(|(other, _)| other == number)
    };
    let is_whole = starts.first().is_some_and(|(at, ..)| *at == 0) && labels.iter().enumerate().all(is_known);
    is_whole.then_some(labels)
}

/// Writes what [`labels_of`] reads.
pub fn labels_text<'a>(labels: impl Iterator<Item = (i128, &'a str)>) -> String {
    let escaped = |text: &str| text.replace('\\', "\\\\").replace(';', "\\;").replace('\n', "\\n");
    labels.map(|(number, text)| format!("{number}={}", escaped(text))).collect::<Vec<_>>().join("; ")
}
