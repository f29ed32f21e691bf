//! Spoiling files: bytes, texts of tokens (RON, JSON), pictures in chunks.

use crate::common::Random;

/// One of several.
pub fn pick<'a, T>(random: &mut Random, of: &'a [T]) -> &'a T {
    &of[random.below(of.len())]
}

/// In place of numbers.
const NUMBERS: [&str; 20] = [
    "NaN",
    "inf",
    "-inf",
    "1e38",
    "-1e38",
    "1e309",
    "1e-45",
    "-1",
    "-0.0",
    "0",
    "1",
    "3",
    "255",
    "65535",
    "4294967295",
    "4294967296",
    "3037000500",
    "18446744073709551615",
    "99999999999999999999999",
    "0x7fffffff",
];

/// In place of strings.
const STRINGS: [&str; 12] = [
    r#""""#,
    r#"".""#,
    r#""..""#,
    r#""../../../../etc/passwd""#,
    r#""/etc/passwd""#,
    r#""/dev/zero""#,
    r#""effects/../../effects/rain.effect.ron""#,
    r#""effects""#,
    r#""\u{0}""#,
    r#""a\nb""#,
    r#"r"x""#,
    r#""\q""#,
];

/// What opens a level, what closes it.
const NESTS: [(&str, &str); 7] = [
    ("(", ")"),
    ("[", "]"),
    ("{\"a\": ", "}"),
    ("{\"a\": (variants: ", ")}"),
    ("Some(", ")"),
    ("/*", "*/"),
    ("(a: ", ")"),
];

/// Many levels, closed or not.
pub fn nested(random: &mut Random) -> String {
    let (open, close) = *pick(random, &NESTS);
    let depth = *pick(random, &[10, 100, 130, 2000, 50_000]);
    let closed = if random.below(2) == 0 { close.repeat(depth) } else { String::new() };
    format!("{}1{closed}", open.repeat(depth))
}

/// Numbers and words, strings, spaces, single signs: put together they are the text again.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || "_.+-".contains(c);
        let end = if first == '"' {
            rest[1..].find('"').map_or(rest.len(), |end| end + 2)
        } else if first.is_whitespace() {
            rest.find(|c: char| !c.is_whitespace()).unwrap_or(rest.len())
        } else if word(first) {
            rest.find(|c: char| !word(c)).unwrap_or(rest.len())
        } else {
            first.len_utf8()
        };
        let (token, behind) = rest.split_at(end);
        tokens.push(token);
        rest = behind;
    }
    tokens
}

fn is_number(token: &str) -> bool {
    token.trim_start_matches(['-', '+']).starts_with(|c: char| c.is_ascii_digit())
}

/// Places of the tokens that are like this.
fn places(tokens: &[String], like: impl Fn(&str) -> bool) -> Vec<usize> {
    (0..tokens.len()).filter(|&at| like(&tokens[at])).collect()
}

/// A text with up to three things wrong; `others` lend it tokens. It need not be valid UTF-8.
pub fn text(random: &mut Random, text: &str, others: &[String]) -> Vec<u8> {
    let mut tokens: Vec<String> = tokens(text).into_iter().map(String::from).collect();
    for _ in 0..=random.below(3) {
        if tokens.is_empty() {
            break;
        }
        spoil(random, &mut tokens, others);
    }
    let mut bytes = tokens.concat().into_bytes();
    if random.below(8) == 0 {
        self::bytes(random, &mut bytes);
    }
    bytes
}

fn spoil(random: &mut Random, tokens: &mut Vec<String>, others: &[String]) {
    let anywhere = random.below(tokens.len());
    let numbers = places(tokens, is_number);
    let strings = places(tokens, |token| token.starts_with('"'));
    match random.below(12) {
        // Most of what is in a file is numbers.
        0..=3 if !numbers.is_empty() => {
            let at = *pick(random, &numbers);
            tokens[at] = (*pick(random, &NUMBERS)).to_owned();
        }
        4 if !strings.is_empty() => {
            let at = *pick(random, &strings);
            tokens[at] = if random.below(8) == 0 {
                format!("{:?}", "a".repeat(10_000))
            } else {
                (*pick(random, &STRINGS)).to_owned()
            };
        }
        5 => {
            let other = random.below(tokens.len());
            tokens.swap(anywhere, other);
        }
        6 => {
            tokens.remove(anywhere);
        }
        7 => duplicate_field(random, tokens),
        8 if !others.is_empty() => {
            let lent = self::tokens(pick::<String>(random, others).as_str());
            if !lent.is_empty() {
                tokens[anywhere] = (*pick(random, &lent)).to_owned();
            }
        }
        9 => tokens.truncate(anywhere),
        10 => tokens[anywhere] = nested(random),
        _ => tokens.insert(
            anywhere,
            (*pick(random, &["(", ")", "[", "]", "{", "}", ",", ":", "\"", "#"])).to_owned(),
        ),
    }
}

/// Says again what a field is.
fn duplicate_field(random: &mut Random, tokens: &mut Vec<String>) {
    let colons = places(tokens, |token| token == ":");
    if colons.is_empty() {
        return;
    }
    let colon = *pick(random, &colons);
    let mut depth = 0i32;
    let end = (colon..tokens.len()).find(|&at| {
        match tokens[at].as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        depth < 0 || (depth == 0 && tokens[at] == ",")
    });
    let (first, end) = (colon.saturating_sub(1), end.unwrap_or(tokens.len()));
    let mut again: Vec<String> = tokens[first..end].to_vec();
    again.push(",".into());
    drop(tokens.splice(first..first, again));
}

/// Bytes that are flipped, cut off, left out, doubled, or become words that numbers stumble over.
pub fn bytes(random: &mut Random, bytes: &mut Vec<u8>) {
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            return;
        }
        let at = random.below(bytes.len());
        let end = (at + 1 + random.below(64)).min(bytes.len());
        match random.below(8) {
            0 | 1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes[at] = random.bits() as u8,
            3 => bytes.truncate(at),
            4 => drop(bytes.drain(at..end)),
            5 => {
                let again = bytes[at..end].to_vec();
                drop(bytes.splice(at..at, again));
            }
            _ => {
                let words: [u32; 8] = [
                    0,
                    1,
                    u32::MAX,
                    i32::MAX as u32,
                    1 << 31,
                    f32::NAN.to_bits(),
                    f32::INFINITY.to_bits(),
                    1.0e38f32.to_bits(),
                ];
                let word = pick(random, &words).to_le_bytes();
                let fits = word.len().min(bytes.len() - at);
                bytes[at..at + fits].copy_from_slice(&word[..fits]);
            }
        }
    }
}

/// A PNG that is spoilt inside a chunk, whose check sum is made to fit again; or one whose bytes are.
pub fn png(random: &mut Random, picture: &[u8]) -> Vec<u8> {
    let mut spoilt = picture.to_vec();
    let chunks = chunks(picture);
    if random.below(3) == 0 || chunks.is_empty() {
        bytes(random, &mut spoilt);
        return spoilt;
    }
    let (start, length) = *pick(random, &chunks);
    let (kind, end) = (start + 4, start + 12 + length);
    match random.below(6) {
        // Twice, or not at all.
        0 => drop(spoilt.splice(start..start, picture[start..end].to_vec())),
        1 => drop(spoilt.drain(start..end)),
        _ => {
            let mut content = picture[kind + 4..kind + 4 + length].to_vec();
            if &picture[kind..kind + 4] == b"IHDR" && random.below(2) == 0 {
                let side: u32 =
                    *pick(random, &[0, 1, 17, 4096, 4097, 8192, 8193, 65_535, 0x7fff_ffff, u32::MAX]);
                let at = 4 * random.below(2);
                content[at..at + 4].copy_from_slice(&side.to_be_bytes());
            } else {
                bytes(random, &mut content);
            }
            let mut chunk = (content.len() as u32).to_be_bytes().to_vec();
            chunk.extend(&picture[kind..kind + 4]);
            chunk.extend(content);
            let sum = crc(&chunk[4..]).to_be_bytes();
            chunk.extend(sum);
            drop(spoilt.splice(start..end, chunk));
        }
    }
    spoilt
}

/// Where chunks begin, and how long their contents are.
fn chunks(picture: &[u8]) -> Vec<(usize, usize)> {
    let (mut chunks, mut at) = (Vec::new(), 8);
    while let Some(length) = picture.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        if at + 12 + length > picture.len() {
            break;
        }
        chunks.push((at, length));
        at += 12 + length;
    }
    chunks
}

/// The check sum of PNG (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(
            crc ^ u32::from(*byte),
            |crc, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 },
        )
    })
}

#[test]
fn tokens_are_the_text_again_and_check_sums_are_those_of_png() {
    let ron = "(name: \"a b\", x: -1.5e3, list: [1, 2], /* ü */ open: \"x";
    assert_eq!(tokens(ron).concat(), ron);
    assert!(tokens(ron).contains(&"-1.5e3") && tokens(ron).contains(&"\"a b\""));
    assert_eq!(crc(b"123456789"), 0xcbf4_3926);
}
