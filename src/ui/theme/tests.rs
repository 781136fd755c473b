//! Contrast of every theme, what a terminal gets, and what is left without colour.

use super::*;
use crate::ui::preferences::Preferences;

fn check(env: &[(&str, &str)], colours: Colours, glyphs: Glyphs) {
    let theme = Theme::detect(|name| env.iter().find(|(key, _)| *key == name).map(|(_, value)| value.to_string()));
    assert_eq!((theme.colours, theme.glyphs), (colours, glyphs), "{env:?}");
}

#[test]
fn a_terminal_gets_what_it_can_show() {
    let utf8 = ("LANG", "en_US.UTF-8");
    check(&[("TERM", "xterm-256color"), ("COLORTERM", "truecolor"), utf8], Colours::True, Glyphs::Braille);
    check(&[("TERM", "tmux-256color"), utf8], Colours::Indexed, Glyphs::Braille);
    check(&[("TERM", "xterm"), utf8], Colours::Sixteen, Glyphs::Braille);
    for term in ["linux", "linux-16color"] {
        check(&[("TERM", term), utf8], Colours::Sixteen, Glyphs::Block);
    }
    check(&[("TERM", "linux")], Colours::Sixteen, Glyphs::Ascii);
    check(&[("TERM", "xterm"), ("LC_ALL", "C"), utf8], Colours::Sixteen, Glyphs::Ascii);
    check(&[("TERM", "vt220")], Colours::None, Glyphs::Ascii);
    check(&[("TERM", "xterm-256color"), ("NO_COLOR", "1"), utf8], Colours::None, Glyphs::Braille);
    check(&[("TERM", "xterm-256color"), ("NO_COLOR", ""), utf8], Colours::Indexed, Glyphs::Braille);
}

#[test]
fn without_colour_no_role_asks_for_one() {
    let theme = Theme::PLAIN;
    let pens = (0..8).map(|n| theme.pen(n));
    let roles = [
        theme.normal(),
        theme.dim(),
        theme.strong(),
        theme.focus(),
        theme.liquid(),
        theme.trouble(),
        theme.severity(Priority::High),
    ];
    for style in pens.chain(roles) {
        assert_eq!((style.fg, style.bg), (None, None));
    }
}

type Rgb = (u8, u8, u8);

const DEPTHS: [Colours; 3] = [Colours::True, Colours::Indexed, Colours::Sixteen];
const PRIORITIES: [Priority; 4] = [Priority::Critical, Priority::High, Priority::Medium, Priority::Low];
const WORDS: [Role; 10] = [
    Role::Normal,
    Role::Dim,
    Role::Strong,
    Role::SetValue,
    Role::Trouble,
    Role::Uncertain,
    Role::Critical,
    Role::High,
    Role::Medium,
    Role::Low,
];

/// The sixteen as a VGA console and as xterm have them.
const VGA: [u32; 16] = [
    0x00_0000, 0xaa_0000, 0x00_aa00, 0xaa_5500, 0x00_00aa, 0xaa_00aa, 0x00_aaaa, 0xaa_aaaa, 0x55_5555, 0xff_5555,
    0x55_ff55, 0xff_ff55, 0x55_55ff, 0xff_55ff, 0x55_ffff, 0xff_ffff,
];
const XTERM: [u32; 16] = [
    0x00_0000, 0xcd_0000, 0x00_cd00, 0xcd_cd00, 0x00_00ee, 0xcd_00cd, 0x00_cdcd, 0xe5_e5e5, 0x7f_7f7f, 0xff_0000,
    0x00_ff00, 0xff_ff00, 0x5c_5cff, 0xff_00ff, 0x00_ffff, 0xff_ffff,
];

fn rgb(colour: Color, sixteen: &[u32; 16]) -> Rgb {
    const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    let number = match colour {
        Color::Rgb(r, g, b) => return (r, g, b),
        Color::Indexed(n @ 232..) => return [8 + (n - 232) * 10; 3].into(),
        Color::Indexed(n) => {
            let level = |step: u8| LEVELS[usize::from((n - 16) / step % 6)];
            return (level(36), level(6), level(1));
        }
        Color::Black => 0,
        Color::Red => 1,
        Color::Green => 2,
        Color::Yellow => 3,
        Color::Blue => 4,
        Color::Magenta => 5,
        Color::Cyan => 6,
        Color::Gray => 7,
        Color::DarkGray => 8,
        Color::LightRed => 9,
        Color::LightGreen => 10,
        Color::LightYellow => 11,
        Color::LightBlue => 12,
        Color::LightMagenta => 13,
        Color::LightCyan => 14,
        Color::White => 15,
        Color::Reset => panic!("a colour of the terminal"),
    };
    let [_, r, g, b] = sixteen[number].to_be_bytes();
    (r, g, b)
}

/// Linear light, as WCAG 2.2 has it.
fn linear((r, g, b): Rgb) -> [f64; 3] {
    [r, g, b].map(|part| {
        let part = f64::from(part) / 255.0;
        if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
    })
}

fn contrast(one: Rgb, other: Rgb) -> f64 {
    let luminance = |colour| {
        let [r, g, b] = linear(colour);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let (one, other) = (luminance(one), luminance(other));
    (one.max(other) + 0.05) / (one.min(other) + 0.05)
}

/// Checks every theme in every depth of colour, the sixteen in both of their usual tones.
fn for_all(mut check: impl FnMut(&str, ThemeName, &dyn Fn(Role) -> Rgb)) {
    for (name, colours) in ThemeName::ALL.into_iter().flat_map(|name| DEPTHS.map(|colours| (name, colours))) {
        for sixteen in [&VGA, &XTERM] {
            let theme = Theme { name, colours, ..Theme::FULL };
            let colour = |role| rgb(theme.colour(role).expect("there are colours"), sixteen);
            check(&format!("{name:?} {colours:?} {sixteen:x?}"), name, &colour);
        }
    }
}

#[test]
fn words_have_a_contrast_of_4_5_on_their_ground() {
    for_all(|what, name, colour| {
        let least = if name == ThemeName::HighContrast && !what.contains("Sixteen") { 7.0 } else { 4.5 };
        for role in WORDS {
            let ratio = contrast(colour(role), colour(Role::Ground));
            assert!(least <= ratio, "{what}: {role:?} has {ratio:.2}");
        }
    });
}

#[test]
fn pens_and_liquid_have_a_contrast_of_3() {
    for_all(|what, _, colour| {
        for role in (0..8).map(Role::Pen).chain([Role::Liquid]) {
            let ratio = contrast(colour(role), colour(Role::Ground));
            assert!(3.0 <= ratio, "{what}: {role:?} has {ratio:.2}");
        }
    });
}

#[test]
fn priorities_differ_by_shape_and_number_alone() {
    for glyphs in [Glyphs::Braille, Glyphs::Block, Glyphs::Ascii] {
        let theme = Theme { glyphs, ..Theme::PLAIN };
        for (n, priority) in PRIORITIES.into_iter().enumerate() {
            let mark = theme.priority_mark(priority);
            assert!(mark.contains(&(n + 1).to_string()), "{mark}");
            assert!(PRIORITIES[..n].iter().all(|other| theme.priority_mark(*other) != mark), "{mark} twice");
        }
    }
}

/// How far apart two colours are seen (OKLab; 0.02 is just noticeable).
fn distance(one: [f64; 3], other: [f64; 3]) -> f64 {
    let lab = |[r, g, b]: [f64; 3]| {
        let l = (0.412_221_5 * r + 0.536_332_5 * g + 0.051_446 * b).max(0.0).cbrt();
        let m = (0.211_903_5 * r + 0.680_699_5 * g + 0.107_397 * b).max(0.0).cbrt();
        let s = (0.088_302_5 * r + 0.281_718_8 * g + 0.629_978_7 * b).max(0.0).cbrt();
        [
            0.210_454 * l + 0.793_618 * m - 0.004_072 * s,
            1.977_998 * l - 2.428_592 * m + 0.450_594 * s,
            0.025_904 * l + 0.782_772 * m - 0.808_676 * s,
        ]
    };
    let (one, other) = (lab(one), lab(other));
    (0..3).map(|n| (one[n] - other[n]).powi(2)).sum::<f64>().sqrt()
}

/// Full protanopia and deuteranopia (Machado, Oliveira and Fernandes 2009), in linear light.
const BLINDNESS: [(&str, [[f64; 3]; 3]); 2] = [
    (
        "protanopia",
        [[0.152_286, 1.052_583, -0.204_868], [0.114_503, 0.786_281, 0.099_216], [-0.003_882, -0.048_116, 1.051_998]],
    ),
    (
        "deuteranopia",
        [[0.367_322, 0.860_646, -0.227_968], [0.280_085, 0.672_501, 0.047_413], [-0.011_820, 0.042_940, 0.968_881]],
    ),
];

#[test]
fn priorities_differ_for_colour_blind_eyes_too() {
    for name in [ThemeName::Grey, ThemeName::Dark, ThemeName::Light, ThemeName::HighContrast] {
        let theme = Theme { name, ..Theme::FULL };
        let light = |priority| linear(rgb(theme.severity(priority).fg.expect("a colour"), &VGA));
        for (blindness, matrix) in BLINDNESS {
            let seen = PRIORITIES.map(|priority| {
                let light = light(priority);
                matrix.map(|row| (0..3).map(|n| row[n] * light[n]).sum::<f64>().clamp(0.0, 1.0))
            });
            for (n, one) in seen.iter().enumerate() {
                for (m, other) in seen.iter().enumerate().skip(n + 1) {
                    let distance = distance(*one, *other);
                    assert!(0.04 <= distance, "{name:?}, {blindness}: {} and {}: {distance:.3}", n + 1, m + 1);
                }
            }
        }
    }
}

#[test]
fn every_cell_of_a_screen_gets_the_ground_of_the_theme() {
    for name in ThemeName::ALL {
        let theme = Theme { name, ..Theme::FULL };
        let ground = theme.colour(Role::Ground).expect("there are colours");
        let mut model = crate::ui::tests::model(&crate::ui::fixture::Fixture::alarm(), Theme::FULL);
        model.preferences_file.set(Some("tech1"), Preferences { theme: name, ..Preferences::default() });
        crate::ui::update(&mut model, crate::ui::Msg::Tick { silent: std::time::Duration::ZERO });
        let buffer = crate::ui::tests::draw(&mut model, 80, 24);
        assert!(buffer.content.iter().all(|cell| cell.bg != Color::Reset && cell.fg != Color::Reset), "{name:?}");
        assert!(buffer.content.iter().filter(|cell| cell.bg == ground).count() > 1000, "{name:?}");
    }
}
