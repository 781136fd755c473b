//! Pictures of the mimic: what a drawing becomes, and what is said of a wrong one.

use super::*;
use crate::plant::def::{MimicItem, MimicRect, Picture};

/// The small plant with this picture, which has rows from the eighth column on, and these aliases.
fn with(picture: &str, aliases: &str) -> Result<PlantDef, Errors> {
    let rows: Vec<&str> = picture.lines().skip(1).map(|row| row.get(8..).unwrap_or("")).collect();
    let drawn = format!("'''\n{}\n'''\n\n[mimic.alias]\n{aliases}", rows.join("\n").trim_end());
    load(PLANT.replace("'''\n {D1.T  }\n'''", &drawn).as_bytes(), METER, PLC)
}

fn drawn(picture: &str, aliases: &str) -> Picture {
    let plant = with(picture, aliases).unwrap_or_else(|errors| panic!("{errors}"));
    plant.mimic.pages[0].pictures[0].clone()
}

/// Corners of a pipe, in how many ways it flows, and whether its direction is known.
type Pipe = (Vec<(u16, u16)>, usize, bool);

fn pipes_of(picture: &Picture) -> Vec<Pipe> {
    let pipe = |item: &MimicItem| match item {
        MimicItem::Pipe { points, flow, directed } => Some((points.clone(), flow.len(), *directed)),
        _ => None,
    };
    picture.items.iter().filter_map(pipe).collect()
}

fn check_wrong(picture: &str, expect: &[&str]) {
    let text = with(picture, "").expect_err("the picture is wrong").to_string();
    for piece in expect {
        assert!(text.contains(piece), "no `{piece}` in\n{text}");
    }
    assert!(text.ends_with("1 problem\n"), "one mistake, one message\n{text}");
}

#[test]
fn a_box_with_a_level_is_a_vessel() {
    let picture = drawn(
        "
        ┌─ TK-1 hot ──┐
        │ {level D1.T}│  in {D1.T   }
        └─────────────┘",
        "",
    );
    let MimicItem::Vessel { place, label, level, inside } = &picture.items[0] else { panic!("{picture:?}") };
    assert_eq!((*place, label.as_str()), (MimicRect { x: 0, y: 0, width: 15, height: 3 }, "TK-1 hot"));
    assert_eq!((level.is_some(), inside.len()), (true, 1));
    let values: Vec<_> = picture
        .items
        .iter()
        .filter_map(|item| match item {
            MimicItem::Value { place, label, .. } => Some((place.x, place.width, label.as_str())),
            _ => None,
        })
        .collect();
    assert_eq!(values, [(2, 12, ""), (17, 12, "in")], "words before a value are its label");
    assert_eq!(picture.size, (29, 3));
}

#[test]
fn a_pipe_is_followed_through_its_symbols_and_turns() {
    let picture = drawn(
        "
        ┌───┐
        │   ╞═{valve D1.MODE}═╗
        └───┘                 ▼
                            ┌─╨─┐
                            └───┘",
        "",
    );
    assert_eq!(pipes_of(&picture), [(vec![(5, 1), (22, 1), (22, 2)], 1, true)]);
    let upright = drawn(
        "
        ┌─╥─┐
        └─┼─┘
          {V}
          ▼
          {D1.T}",
        "V = \"valve D1.MODE V-1 flow=D1.T\"",
    );
    assert_eq!(pipes_of(&upright), [(vec![(2, 2), (2, 3)], 1, true)]);
    assert!(
        upright
            .items
            .iter()
            .any(|item| matches!(item, MimicItem::Valve { vertical: true, label, .. } if label == "V-1"))
    );
}

#[test]
fn an_arrow_decides_the_direction_and_a_joint_gives_the_flow() {
    let picture = drawn(
        "
        a ═{pump D1.MODE}═►═╗
                            ╠═► c
        b ═{pump PLC.OUT}═►═╝",
        "",
    );
    let pipes = pipes_of(&picture);
    assert_eq!(pipes.len(), 3, "{pipes:?}");
    let into: Vec<_> = pipes.iter().filter(|(points, ..)| points.last() == Some(&(20, 1))).collect();
    assert_eq!(into.len(), 2, "both lead into the joint: {pipes:?}");
    let out = pipes.iter().find(|(points, ..)| points.first() == Some(&(20, 1))).expect("one leads out of it");
    assert_eq!((out.1, out.2), (2, true), "it flows while one of two flows");
    let joint = picture.items.iter().find(|item| matches!(item, MimicItem::Joint { .. }));
    assert_eq!(joint, Some(&MimicItem::Joint { at: (20, 1), branches: 1 | 2 | 8 }));
    let back = drawn(
        "
        a ═◄═{pump D1.MODE}═ b",
        "",
    );
    assert_eq!(pipes_of(&back), [(vec![(19, 0), (2, 0)], 1, true)]);
}

/// In how many ways the pipe that begins here flows, and whether one of them is unknown.
fn flow_from(picture: &Picture, start: (u16, u16)) -> (usize, bool) {
    let pipe = picture.items.iter().find_map(|item| match item {
        MimicItem::Pipe { points, flow, .. } if points.first() == Some(&start) => Some(flow),
        _ => None,
    });
    let flow = pipe.unwrap_or_else(|| panic!("no pipe from {start:?}: {picture:?}"));
    (flow.len(), flow.iter().any(Vec::is_empty))
}

#[test]
fn an_inlet_does_not_take_the_flow_of_its_neighbour() {
    let picture = drawn(
        "
        a ═►════════════════╗
                            ╠═► c
        b ═{pump PLC.OUT}═►═╝",
        "",
    );
    assert_eq!(flow_from(&picture, (2, 0)), (1, true), "nothing measures a: {picture:?}");
    assert_eq!(flow_from(&picture, (2, 2)), (1, false));
    assert_eq!(flow_from(&picture, (20, 1)), (2, true), "c flows while the pump runs, else it may");
}

#[test]
fn a_flow_passes_any_number_of_joints() {
    let picture = drawn(
        "
        a ═{pump PLC.OUT}═►═╦═►═╦═►═╦═► b
                            ▼   ▼   ▼
                            c   d   e",
        "",
    );
    for start in [(20, 0), (24, 0), (28, 0)] {
        assert_eq!(flow_from(&picture, start), (1, false), "{start:?}: {picture:?}");
    }
    let circle = drawn(
        "
        ╔═►═╦═► b
        ║   ║
        ╚═══╝",
        "",
    );
    assert_eq!(flow_from(&circle, (4, 0)), (1, true), "a loop without a pump is unknown: {circle:?}");
}

#[test]
fn a_circle_of_pipe_has_no_end() {
    let picture = drawn(
        "
        ╔══►══╗
        ║     ║
        ╚═════╝",
        "",
    );
    let pipes = pipes_of(&picture);
    assert_eq!(pipes.len(), 1, "{pipes:?}");
    assert_eq!(pipes[0].0.first(), pipes[0].0.last());
}

#[test]
fn what_cannot_be_drawn_is_shown_in_the_picture() {
    check_wrong("\n        {D1.T", &["[small.toml:33:1]", "`{` without `}` in its row"]);
    check_wrong("\n        {D1.X  }", &["[small.toml:33:2]", "unknown tag `D1.X`", "did you mean `D1.T`?"]);
    check_wrong("\n        {vlve D1.MODE}", &["unknown symbol `vlve`", "did you mean `valve`?"]);
    check_wrong(
        "\n        {trend D1.T 30}",
        &["`30` means nothing here", "expected a size as 30x5 or a window as 1h, from 1min to 100 days"],
    );
    check_wrong("\n        {trend D1.T 0s}", &["`0s` means nothing here"]);
    check_wrong("\n        {trend D1.T 200000000h}", &["`200000000h` means nothing here", "to 100 days"]);
    check_wrong("\n        a ═{valve D1.MODE 30x5}═ b", &["`30x5` means nothing here", "a label or flow=TAG"]);
    check_wrong("\n        {D1.T 30x5}", &["`30x5` means nothing here", "expected }"]);
    check_wrong("\n        {bar D1.T 9999x9999}", &["9999 by 9999 cells cannot be drawn", "expected 1x1 to 500x200"]);
    check_wrong("\n        {bar D1.T 0x1}", &["0 by 1 cells cannot be drawn"]);
    check_wrong("\n        {level D1.T}", &["a level outside of a box"]);
    check_wrong(
        "\n        ┌──┐\n        │  │",
        &["[small.toml:33:1]", "not closed", "expected │ or └ in row 3, column 1"],
    );
    check_wrong("\n        ┌──┐\n        └── ┘", &["expected ┘ in row 2, column 4 of the picture"]);
    check_wrong("\n        x ── y", &["a thin line that belongs to no closed box", "pipes are drawn with ═ and ║"]);
    check_wrong("\n        a ═══   b", &["[small.toml:33:5]", "a gap in a pipe", "column 6, row 1 of the picture"]);
    check_wrong("\n        a ═►═◄═ b", &["[small.toml:33:6]", "arrows of one pipe point against each other"]);
    check_wrong(
        "\n        a ══║\n            ║\n            c",
        &["`║` in column 5, row 1 of the picture has no branch"],
    );
    check_wrong(
        "\n        {trend D1.T 9x2}\n        x",
        &["this covers something else", "row 2, column 1 of the picture"],
    );
}

/// The warnings of a plant file, whose meters have this profile.
pub(super) fn warnings(plant: &str, meter: &str) -> Vec<String> {
    let plant = Text { file: "small.toml".to_owned(), bytes: plant.as_bytes().to_vec() };
    let find = |name: &str| {
        let text = if name == "meter" { meter } else { PLC };
        Ok(Some(Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() }))
    };
    let library = Library { find: &find, names: Vec::new(), is_program: &|_| true };
    let (_, warnings) = build("small", &plant, &library).unwrap();
    warnings.lines().collect()
}

#[test]
fn a_value_that_needs_more_room_is_warned_of() {
    let warned = |picture: &str| {
        let plant = PLANT.replace(" {D1.T  }", picture).replace("decimals_from = \"DP\"\n", "");
        let lines = warnings(&plant, &METER.replace("decimals_from = \"DP\"", "decimals = 1"));
        lines.into_iter().filter(|line| line.contains("columns")).collect::<Vec<_>>()
    };
    assert!(warned("{D1.T  }").is_empty());
    assert_eq!(warned("{D1.T}x"), ["small.toml:33:1: D1.T needs 8 columns, here are 6"]);
}

#[test]
fn a_picture_with_too_many_pipes_is_reported() {
    let mesh = |rows: usize| format!("\n{}", format!("        {}\n", "╬".repeat(20)).repeat(rows));
    assert!(with(&mesh(20), "").is_ok());
    check_wrong(&mesh(30), &["a picture of 1150 pipes cannot be drawn", "expected at most 1000"]);
}

#[test]
fn pages_have_names_and_link_to_each_other() {
    let text = PLANT.replace(
        "picture = '''\n {D1.T  }\n'''",
        "name = \"Hot\"\npicture = '''\n {page Cold side}\n'''\n\n[[mimic.page]]\nname = \"Cold side\"\n\
         picture = ['''\n {D1.T  } small\n''', '''\n {D1.T  }\n\n large\n''']\n",
    );
    let plant = load(text.as_bytes(), METER, PLC).unwrap_or_else(|errors| panic!("{errors}"));
    let names: Vec<&str> = plant.mimic.pages.iter().map(|page| page.name.as_str()).collect();
    assert_eq!(names, ["Hot", "Cold side"]);
    assert!(plant.mimic.pages[0].pictures[0].items.iter().any(|item| matches!(item, MimicItem::Link { page: 1, .. })));
    let cold = &plant.mimic.pages[1];
    assert_eq!(cold.pictures.len(), 2);
    assert_eq!(cold.picture((80, 2)).size.1, 1, "the largest that fits");
    assert_eq!(cold.picture((5, 1)).size, cold.pictures[0].size, "the smallest where none fits");
}

#[test]
fn pages_without_a_name_or_a_picture_are_reported() {
    let check = |mimic: &str, expect: &str| {
        let text = PLANT.replace("picture = '''\n {D1.T  }\n'''", mimic);
        let text = load(text.as_bytes(), METER, PLC).expect_err("the pages are wrong").to_string();
        assert!(text.contains(expect) && text.ends_with("1 problem\n"), "no `{expect}` in\n{text}");
    };
    let page = |keys: &str| format!("name = \"Hot\"\npicture = 'x'\n[[mimic.page]]\n{keys}");
    check(&page("name = \"Cold\""), "a page of the mimic needs `picture`");
    check(&page("name = \"Cold\"\npicture = []"), "a page without a picture");
    check(&page("name = \"Hot\"\npicture = 'x'"), "duplicate page `Hot`");
    check(&page("name = \" \"\npicture = 'x'"), "a page without a name");
    check("name = \"Hot\"", "a page without a picture");
    let many: String = (0..100).map(|n| format!("[[mimic.page]]\nname = \"{n}\"\npicture = 'x'\n")).collect();
    check(&format!("name = \"Hot\"\npicture = 'x'\n{many}"), "101 pages of the mimic are too many");
    let unnamed = "picture = 'x'\n[[mimic.page]]\nname = \"Cold\"\npicture = 'x'";
    check(unnamed, "the first of several pages needs a name");
}

#[test]
fn a_warning_of_size_is_about_the_smallest_picture() {
    let wide = |columns: usize| format!("'''\n {}\n'''", "x".repeat(columns));
    let plant = PLANT.replace("'''\n {D1.T  }\n'''", &format!("[{},\n{}]", wide(120), wide(90)));
    let size: Vec<String> = warnings(&plant, METER).into_iter().filter(|line| line.contains("80 by 24")).collect();
    assert_eq!(size.len(), 1, "{size:?}");
    assert!(size[0].starts_with("small.toml:35:") && size[0].contains("91 by 1"), "{size:?}");
}

#[test]
fn areas_that_cover_each_other_take_no_cells() {
    let many = vec!["{bar D1.T 500x200}".repeat(20); 150].join("\n");
    let plant = PLANT.replace(" {D1.T  }", &many);
    let text = load(plant.as_bytes(), METER, PLC).expect_err("they cover each other").to_string();
    assert!(text.contains("this covers something else"), "{text}");
}

#[test]
fn the_example_of_the_format_page_is_right() {
    use crate::profile::{FORMAT_PAGE, Search, load, text_of};
    let example = FORMAT_PAGE.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
    let tank = text_of("tank", &Search::shipped()).expect("a shipped plant");
    let (before, after) = (tank.split("[mimic]").next().unwrap(), tank.split_once("[[mimic.command]]").unwrap().1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tank.toml");
    std::fs::write(&path, format!("{before}{example}\n[[mimic.command]]{after}")).unwrap();
    let plant = load(&path, &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(plant.mimic.pages[0].pictures.len(), 1);
}

#[test]
fn the_format_page_explains_every_symbol() {
    use crate::profile::{FORMAT_PAGE, picture::SymbolKind};
    for kind in SymbolKind::ALL.into_iter().filter(|kind| *kind != SymbolKind::Value) {
        assert!(FORMAT_PAGE.contains(&format!("`{{{} ", kind.word())), "{}", kind.word());
    }
}
