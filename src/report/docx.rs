//! A report as a Word document (Office Open XML): headings, tables whose heads are repeated on every page, curves as pictures.
//!
//! Written here and not by a library: docx-rs has no repeated heads, and numbers its paragraphs in one sequence for the whole process, so that
//! the same report would be another file each time.

use std::{
    fmt::Write as _,
    io::{Cursor, Write as _},
};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::{
    ReportFormat, Style,
    document::{Cell, Column, ColumnKind, Content, Document, Fact, Section, Table},
    drawing::{Drawing, escaped},
};
use crate::plant::def::Paper;

/// The format `docx`.
#[derive(Debug)]
pub struct Docx;

impl ReportFormat for Docx {
    fn name(&self) -> &'static str {
        "docx"
    }
    fn about(&self) -> &'static str {
        "a Word document"
    }

    fn extension(&self) -> &'static str {
        "docx"
    }

    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String> {
        let body = document.locale.within(|| Body::of(document));
        body.package(document, style).map_err(|error| error.to_string())
    }
}

/// Width of a chart in pixels, and English metric units of a pixel.
const CHART: u16 = 680;
const EMU: u32 = 9_525;
/// Width of the text in twentieths of a point: A4 and Letter less two margins of 15 mm.
const WIDTHS: [u32; 2] = [11_906 - 1_700, 12_240 - 1_700];
/// Schemas of the namespaces.
const W: &str = "http://schemas.openxmlformats.org/wordprocessingml/2006/main";
const RELATIONS: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
const PACKAGE: &str = "http://schemas.openxmlformats.org/package/2006";
const DRAWING: &str = "http://schemas.openxmlformats.org/drawingml/2006";

/// The paragraphs and tables, and the pictures that they show.
struct Body {
    xml: String,
    pictures: Vec<Vec<u8>>,
}

impl Body {
    fn of(document: &Document) -> Body {
        let mut body = Body { xml: String::new(), pictures: Vec::new() };
        if !document.logo.is_empty() {
            body.paragraph("", &document.logo);
        }
        body.paragraph("Title", &document.title);
        body.paragraph("", &document.heading);
        body.paragraph("", &document.times_line());
        document.sections.iter().for_each(|section| body.section(document, section));
        body
    }

    fn add(&mut self, what: std::fmt::Arguments) {
        // Writing into a string never fails.
        let _ = self.xml.write_fmt(what);
    }

    fn paragraph(&mut self, style: &str, text: &str) {
        let style =
            if style.is_empty() { String::new() } else { format!("<w:pPr><w:pStyle w:val=\"{style}\"/></w:pPr>") };
        self.add(format_args!("<w:p>{style}{}</w:p>", run(text, false)));
    }

    fn section(&mut self, document: &Document, section: &Section) {
        self.paragraph("Heading1", &section.title);
        match &section.content {
            Content::Facts(facts) => {
                let row = |Fact { name, cell, .. }: &Fact| vec![(name.clone(), false), (document.fact(cell), false)];
                self.table(&[], &facts.iter().map(row).collect::<Vec<_>>());
            }
            Content::Table(table) => self.rows(document, &table.dense()),
            Content::Charts(charts) => {
                charts.iter().for_each(|chart| self.picture(&chart.drawing(&document.zone, CHART)));
            }
            Content::Signatures(names) => {
                names.iter().for_each(|name| self.paragraph("Signature", &format!("{name}  {}", "_".repeat(40))));
            }
        }
    }

    fn rows(&mut self, document: &Document, table: &Table) {
        let heads: Vec<(String, bool)> = table
            .columns
            .iter()
            .map(|Column { heading, kind, .. }| (heading.clone(), *kind == ColumnKind::Number))
            .collect();
        let cell =
            |(cell, column): (&Cell, &Column)| (document.words(cell, column.kind), column.kind == ColumnKind::Number);
        let row = |row: &Vec<Cell>| row.iter().zip(&table.columns).map(cell).collect::<Vec<_>>();
        self.table(&heads, &table.rows.iter().map(row).collect::<Vec<_>>());
    }

    /// Rows of cells, each with its text and whether it stands to the right.
    fn table(&mut self, heads: &[(String, bool)], rows: &[Vec<(String, bool)>]) {
        self.xml.push_str(
            "<w:tbl><w:tblPr><w:tblStyle w:val=\"Report\"/><w:tblW w:w=\"5000\" w:type=\"pct\"/></w:tblPr><w:tblGrid>",
        );
        let columns = if heads.is_empty() { 2 } else { heads.len() };
        (0..columns).for_each(|_| self.xml.push_str("<w:gridCol/>"));
        self.xml.push_str("</w:tblGrid>");
        if !heads.is_empty() {
            self.row(heads, true);
        }
        rows.iter().for_each(|row| self.row(row, false));
        // Word joins two tables that touch.
        self.xml.push_str("</w:tbl><w:p/>");
    }

    fn row(&mut self, cells: &[(String, bool)], head: bool) {
        let repeated = if head { "<w:tblHeader/>" } else { "" };
        self.add(format_args!("<w:tr><w:trPr><w:cantSplit/>{repeated}</w:trPr>"));
        for (place, (text, right)) in cells.iter().enumerate() {
            let shade = if head { "<w:shd w:val=\"clear\" w:fill=\"F2F2F2\"/>" } else { "" };
            // A name is not broken at its hyphen.
            let whole = if place == 0 { "<w:noWrap/>" } else { "" };
            let align = if *right { "<w:jc w:val=\"right\"/>" } else { "" };
            self.add(format_args!(
                "<w:tc><w:tcPr>{shade}{whole}</w:tcPr><w:p><w:pPr><w:pStyle w:val=\"Cell\"/>{align}</w:pPr>{}</w:p></w:tc>",
                run(text, head)
            ));
        }
        self.xml.push_str("</w:tr>");
    }

    fn picture(&mut self, drawing: &Drawing) {
        let Some(png) = drawing.png() else { return };
        self.pictures.push(png);
        let (number, (width, height)) = (self.pictures.len(), drawing.size());
        let (width, height) = (u32::from(width) * EMU, u32::from(height) * EMU);
        self.add(format_args!(
            "<w:p><w:r><w:drawing><wp:inline distT=\"0\" distB=\"0\" distL=\"0\" distR=\"0\">\
             <wp:extent cx=\"{width}\" cy=\"{height}\"/><wp:docPr id=\"{number}\" name=\"chart {number}\"/>\
             <a:graphic><a:graphicData uri=\"{DRAWING}/picture\"><pic:pic><pic:nvPicPr>\
             <pic:cNvPr id=\"{number}\" name=\"chart{number}.png\"/><pic:cNvPicPr/></pic:nvPicPr>\
             <pic:blipFill><a:blip r:embed=\"rId{number}\"/><a:stretch><a:fillRect/></a:stretch></pic:blipFill>\
             <pic:spPr><a:xfrm><a:off x=\"0\" y=\"0\"/><a:ext cx=\"{width}\" cy=\"{height}\"/></a:xfrm>\
             <a:prstGeom prst=\"rect\"><a:avLst/></a:prstGeom></pic:spPr></pic:pic></a:graphicData></a:graphic>\
             </wp:inline></w:drawing></w:r></w:p>"
        ));
    }

    /// The parts of the file.
    fn package(&self, document: &Document, style: &Style) -> zip::result::ZipResult<Vec<u8>> {
        let ((width, height), text) = match style.paper {
            Paper::A4 => ((11_906, 16_838), WIDTHS[0]),
            Paper::Letter => ((12_240, 15_840), WIDTHS[1]),
        };
        let margin = (width - text) / 2;
        let page = format!(
            "<w:sectPr><w:footerReference w:type=\"default\" r:id=\"foot\"/><w:pgSz w:w=\"{width}\" w:h=\"{height}\"/>\
             <w:pgMar w:top=\"{margin}\" w:right=\"{margin}\" w:bottom=\"{margin}\" w:left=\"{margin}\" \
             w:header=\"400\" w:footer=\"400\" w:gutter=\"0\"/></w:sectPr>"
        );
        let main = format!(
            "<w:document xmlns:w=\"{W}\" xmlns:r=\"{RELATIONS}\" xmlns:a=\"{DRAWING}/main\" xmlns:pic=\"{DRAWING}/picture\" \
             xmlns:wp=\"{DRAWING}/wordprocessingDrawing\"><w:body>{}{page}</w:body></w:document>",
            self.xml
        );
        let mut parts: Vec<(String, Vec<u8>)> = vec![
            ("[Content_Types].xml".into(), xml(CONTENT_TYPES)),
            ("_rels/.rels".into(), xml(&relations(&[("main", "officeDocument", "word/document.xml".to_owned())]))),
            ("docProps/core.xml".into(), xml(&properties(document))),
            ("word/document.xml".into(), xml(&main)),
            ("word/styles.xml".into(), xml(&styles(document))),
            ("word/footer1.xml".into(), xml(&footer(document))),
            ("word/_rels/document.xml.rels".into(), xml(&self.links())),
        ];
        let pictures = (1..).zip(&self.pictures);
        parts.extend(pictures.map(|(number, png)| (format!("word/media/chart{number}.png"), png.clone())));
        let mut file = ZipWriter::new(Cursor::new(Vec::new()));
        // Not the time of making: the same report is the same file.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(zip::DateTime::default());
        for (name, bytes) in parts {
            file.start_file(name, options)?;
            file.write_all(&bytes)?;
        }
        Ok(file.finish()?.into_inner())
    }

    fn links(&self) -> String {
        let mut links =
            vec![("styles", "styles", "styles.xml".to_owned()), ("foot", "footer", "footer1.xml".to_owned())];
        let names: Vec<String> = (1..=self.pictures.len()).map(|number| format!("rId{number}")).collect();
        let pictures =
            names.iter().zip(1..).map(|(name, number)| (name.as_str(), "image", format!("media/chart{number}.png")));
        links.extend(pictures);
        relations(&links)
    }
}

const CONTENT_TYPES: &str = "<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">\
    <Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\
    <Default Extension=\"xml\" ContentType=\"application/xml\"/><Default Extension=\"png\" ContentType=\"image/png\"/>\
    <Override PartName=\"/word/document.xml\" ContentType=\"application/vnd.openxmlformats-officedocument.wordprocessingml.document.main+xml\"/>\
    <Override PartName=\"/word/styles.xml\" ContentType=\"application/vnd.openxmlformats-officedocument.wordprocessingml.styles+xml\"/>\
    <Override PartName=\"/word/footer1.xml\" ContentType=\"application/vnd.openxmlformats-officedocument.wordprocessingml.footer+xml\"/>\
    <Override PartName=\"/docProps/core.xml\" ContentType=\"application/vnd.openxmlformats-package.core-properties+xml\"/></Types>";

fn xml(body: &str) -> Vec<u8> {
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n{body}").into_bytes()
}

/// Relations by id, kind and target.
fn relations(links: &[(&str, &str, String)]) -> String {
    let link = |(id, kind, target): &(&str, &str, String)| {
        format!("<Relationship Id=\"{id}\" Type=\"{RELATIONS}/{kind}\" Target=\"{target}\"/>")
    };
    let core = format!(
        "<Relationship Id=\"core\" Type=\"{PACKAGE}/relationships/metadata/core-properties\" Target=\"docProps/core.xml\"/>"
    );
    let links: String = links.iter().map(link).collect();
    let core = if links.contains("officeDocument\" Target") { core.as_str() } else { "" };
    format!("<Relationships xmlns=\"{PACKAGE}/relationships\">{links}{core}</Relationships>")
}

/// A run of text: also its complex script, Thai, has the font and the weight.
fn run(text: &str, bold: bool) -> String {
    let weight = if bold { "<w:rPr><w:b/><w:bCs/></w:rPr>" } else { "" };
    format!("<w:r>{weight}<w:t xml:space=\"preserve\">{}</w:t></w:r>", escaped(text))
}

fn properties(document: &Document) -> String {
    let (title, made) = (escaped(&format!("{}: {}", document.title, document.heading)), document.until);
    let time = |name: &str| format!("<dcterms:{name} xsi:type=\"dcterms:W3CDTF\">{made:.0}</dcterms:{name}>");
    format!(
        "<cp:coreProperties xmlns:cp=\"{PACKAGE}/metadata/core-properties\" xmlns:dc=\"http://purl.org/dc/elements/1.1/\" \
         xmlns:dcterms=\"http://purl.org/dc/terms/\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\">\
         <dc:title>{title}</dc:title><dc:creator>sightglass</dc:creator>{}{}</cp:coreProperties>",
        time("created"),
        time("modified")
    )
}

fn footer(document: &Document) -> String {
    let field = |name: &str| format!("<w:fldSimple w:instr=\"{name}\"><w:r><w:t>1</w:t></w:r></w:fldSimple>");
    let (page, pages) = (field("PAGE"), field("NUMPAGES"));
    let heading = run(&format!("{}   {}   ", document.title, document.heading), false);
    format!(
        "<w:ftr xmlns:w=\"{W}\"><w:p><w:pPr><w:pStyle w:val=\"Cell\"/><w:jc w:val=\"center\"/></w:pPr>{heading}{page}{}{pages}</w:p></w:ftr>",
        run(" / ", false)
    )
}

/// Sizes are in half points; each is given for Latin and for complex scripts.
fn styles(document: &Document) -> String {
    let language = if document.locale.language.code() == "th" { "th-TH" } else { "en-GB" };
    let paragraph = |id: &str, more: &str, size: u8, bold: &str| {
        format!(
            "<w:style w:type=\"paragraph\" w:styleId=\"{id}\"><w:name w:val=\"{id}\"/><w:pPr>{more}</w:pPr>\
             <w:rPr>{bold}<w:sz w:val=\"{size}\"/><w:szCs w:val=\"{size}\"/></w:rPr></w:style>"
        )
    };
    let bold = "<w:b/><w:bCs/>";
    let none = "<w:spacing w:before=\"0\" w:after=\"0\"/>";
    let border = |side: &str| format!("<w:{side} w:val=\"single\" w:sz=\"4\" w:color=\"BBBBBB\"/>");
    let borders: String = ["top", "bottom", "insideH"].map(border).concat();
    format!(
        "<w:styles xmlns:w=\"{W}\"><w:docDefaults><w:rPrDefault><w:rPr>\
         <w:rFonts w:ascii=\"Sarabun\" w:hAnsi=\"Sarabun\" w:cs=\"Sarabun\"/><w:sz w:val=\"20\"/><w:szCs w:val=\"20\"/>\
         <w:lang w:val=\"en-GB\" w:bidi=\"{language}\"/></w:rPr></w:rPrDefault></w:docDefaults>{}{}{}{}\
         <w:style w:type=\"table\" w:styleId=\"Report\"><w:name w:val=\"Report\"/><w:tblPr><w:tblBorders>{borders}</w:tblBorders>\
         <w:tblCellMar><w:left w:w=\"60\" w:type=\"dxa\"/><w:right w:w=\"60\" w:type=\"dxa\"/></w:tblCellMar></w:tblPr></w:style></w:styles>",
        paragraph("Title", none, 32, bold),
        paragraph(
            "Heading1",
            "<w:keepNext/><w:spacing w:before=\"240\" w:after=\"80\"/><w:outlineLvl w:val=\"0\"/>",
            24,
            bold
        ),
        paragraph("Cell", none, 16, ""),
        paragraph("Signature", "<w:spacing w:before=\"600\"/>", 20, ""),
    )
}
