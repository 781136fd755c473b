//! The words of a heading: what a column below it can be.

use super::{
    columns::{Said, is_address, said_of},
    heat_pump, register_names,
    words::is_sized_type,
};
use crate::plant::{address::AddressBase, keyword::keyword_enum};

keyword_enum! {
    /// What a column holds.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Column: "meaning" {
        /// Of the first register.
        Address => "address",
        /// The same, whose digits are hexadecimal without a mark.
        HexAddress => "hex address",
        /// What it is called.
        Name => "name",
        /// Type of the raw value.
        Type => "type",
        /// `yes`, `no`.
        Signed => "signed",
        /// Registers.
        Length => "registers",
        /// Its bytes.
        Bytes => "bytes",
        /// How many bits a number has.
        Width => "width in bits",
        /// It multiplies.
        Scale => "factor",
        /// It divides.
        Divisor => "divisor",
        /// Of ten.
        Exponent => "power of ten",
        /// Digits behind the point that the number does not have.
        Places => "implied decimals",
        /// Added after scaling.
        Offset => "offset",
        /// `°C`.
        Unit => "unit",
        /// One of the four, as word or function code.
        Table => "table",
        /// One of the four, as the digit of Modicon: 4 is a holding register.
        Area => "area",
        /// Of bytes and words.
        Order => "byte order",
        /// Unit address.
        Device => "unit address",
        /// More than a scale and an offset.
        Formula => "formula",
        /// `r`, `rw`, `w`.
        Access => "access",
        /// Least value that may be written.
        Min => "least",
        /// The greatest.
        Max => "greatest",
        /// Decimals to show.
        Decimals => "decimals",
        /// `0=off; 1=on`: names of numbers.
        Labels => "names of numbers",
        /// The same of bits.
        Bits => "names of bits",
        /// `5-4`, `3`: bits of a register.
        Field => "bits",
        /// Raw numbers that mean "no value".
        Bad => "no value",
        /// What it belongs to.
        Group => "group",
        /// What it is called at length.
        Label => "label",
        /// `holding:7`: where it is written.
        WriteAt => "write address",
        /// The function that writes it.
        WriteWith => "write function",
        /// `30s`: how often it is read.
        Poll => "poll period",
    }
}

/// The columns of an export of this program, in their order.
pub const OWN: [(Column, &str); 21] = [
    (Column::Address, "address"),
    (Column::Table, "table"),
    (Column::Name, "name"),
    (Column::Type, "type"),
    (Column::Order, "byte order"),
    (Column::Field, "field"),
    (Column::Scale, "scale"),
    (Column::Offset, "offset"),
    (Column::Decimals, "decimals"),
    (Column::Unit, "unit"),
    (Column::Access, "access"),
    (Column::Min, "min"),
    (Column::Max, "max"),
    (Column::Labels, "enum"),
    (Column::Bits, "bits"),
    (Column::Bad, "bad if"),
    (Column::Group, "group"),
    (Column::Label, "label"),
    (Column::WriteAt, "write address"),
    (Column::WriteWith, "write function"),
    (Column::Poll, "poll"),
];

#[rustfmt::skip]
const ADDRESS: &[&str] = &["address", "addr", "addr.", "register", "reg", "reg.", "modicon", "pdu", "wire", "hex", "dec",
    "adresse", "adr", "adr.", "registeradresse", "registernummer", "modbusadresse", "startadresse", "modbusregister", "startregister", "dirección", "indirizzo", "endereço", "adres", "adress", "registre", "registro", "rejestr", "адрес", "регистр", "地址", "寄存器地址", "寄存器", "ที่อยู่", "แอดเดรส"];
/// Words of headings, in small letters. Of several columns that a heading can be, the first that fits what is in it counts.
#[rustfmt::skip]
const HEADINGS: [(Column, &[&str]); 17] = [
    (Column::Divisor, &["divisor", "divide", "divider", "division", "div", "teiler", "diviseur", "divisore", "deler", "dzielnik", "делитель", "除数", "ตัวหาร"]),
    (Column::Exponent, &["sf", "exponent", "zehnerpotenz"]),
    (Column::Scale, &["scale", "scaling", "factor", "multiplier", "multiply", "gain", "resolution", "coefficient", "sf", "ratio", "conversion", "scalefactor",
        "faktor", "skalierung", "skalierungsfaktor", "umrechnung", "umrechnungsfaktor", "multiplikator", "auflösung", "risoluzione", "skala", "échelle", "facteur", "résolution", "escala", "fattore", "fator", "schaal", "mnożnik", "skalfaktor", "множитель", "коэффициент", "масштаб", "系数", "倍率", "ตัวคูณ"]),
    (Column::Order, &["order", "endian", "endianness", "swap", "byteorder", "wordorder", "reihenfolge", "bytereihenfolge", "wortreihenfolge"]),
    (Column::Device, &["deviceid", "slave", "slaveid", "station", "unit", "geräteadresse"]),
    (Column::Unit, &["unit", "units", "uom", "dimension", "einheit", "einheiten", "maßeinheit", "unité", "unidad", "unidades", "unità", "unidade", "eenheid", "jednostka", "enhet", "единица", "единицы", "单位", "หน่วย"]),
    (Column::Signed, &["signed", "sign", "vorzeichen"]),
    (Column::Type, &["type", "format", "datatype", "dataformat", "encoding", "size", "signed", "sign", "typ", "datentyp", "datenformat", "variablentyp", "tipo", "formato", "formaat", "тип", "类型", "数据类型", "ชนิด", "ชนิดข้อมูล"]),
    (Column::Width, &["bit", "bits", "size", "length", "width", "länge", "größe", "bitbreite"]),
    (Column::Field, &["bit", "bits", "bitnr", "bitnummer", "bitposition"]),
    (Column::Table, &["table", "function", "area", "fc", "type", "tabelle", "funktionscode", "funktion", "bereich", "registertyp", "registertype", "regtype", "space", "typ", "tipo", "función", "fonction", "funzione", "функция", "功能码", "ฟังก์ชัน"]),
    (Column::Length, &["len", "length", "size", "count", "quantity", "qty", "words", "registers", "bytes", "länge", "anzahl", "wörter", "größe", "registeranzahl", "datenlänge", "longueur", "registres", "mots", "longitud", "registros", "lunghezza", "registri", "lengte", "długość", "длина", "长度", "数量", "ความยาว", "จำนวน"]),
    (Column::Formula, &["formula", "expression", "formel"]),
    (Column::Offset, &["offset", "versatz", "décalage", "смещение", "偏移"]),
    (Column::Access, &["access", "rw", "permission", "permissions", "attribute", "attributes", "mode", "modus", "zugriff", "zugriffsart", "accès", "acceso", "accesso", "toegang", "dostęp", "доступ", "访问", "读写", "属性", "读写属性"]),
    (Column::Address, ADDRESS),
    (Column::Name, &["name", "title", "parameter", "description", "tag", "label", "signal", "variable", "meaning", "point", "function", "nickname", "tagname", "purpose", "item", "field", "content", "quantity",
        "bezeichnung", "beschreibung", "benennung", "bedeutung", "datenpunkt", "messwert", "messgröße", "titel", "parametername", "funktion", "kommentar", "désignation", "nom", "libellé", "nombre", "descripción", "nome", "descrizione", "descrição", "naam", "omschrijving", "nazwa", "opis", "namn", "benämning", "beskrivning", "название", "наименование", "описание", "параметр", "名称", "描述", "参数", "ชื่อ", "คำอธิบาย"]),
];
/// A heading with one of these alone is no column of addresses: tables of codes have them too.
const WEAK: [&str; 2] = ["hex", "dec"];
/// Parts of words that say how digits are written.
const HEX: [&str; 6] = ["hex", "esadec", "szesnast", "шестнадцат", "十六进制", "16进制"];
const DECIMAL: [&str; 5] = ["dec", "dez", "déc", "дес", "十进制"];
/// A heading of these says the table of each row.
const TABLES: [&str; 6] = ["table", "space", "area", "regtype", "registertype", "registertyp"];
/// The last address of several.
const LAST: [&str; 9] = ["end", "to", "last", "stop", "ende", "bis", "endadresse", "endregister", "fin"];
/// Words of names that stand in other columns too, and those of long texts.
const WEAK_NAMES: [&str; 10] =
    ["function", "funktion", "signal", "variable", "point", "purpose", "item", "field", "content", "quantity"];
const TEXTS: [&str; 7] =
    ["description", "beschreibung", "kommentar", "descripción", "descrizione", "descrição", "描述"];
const NAMES: [&str; 9] =
    ["name", "title", "parameter", "tag", "label", "nickname", "tagname", "bezeichnung", "parametername"];
/// Columns below these say nothing about how a number is read, whatever numbers they hold.
#[rustfmt::skip]
const HARMLESS: [&str; 42] = [
    "min", "min.", "minimum", "max", "max.", "maximum", "range", "limit", "limits", "default", "value", "values", "example", "page", "no", "no.", "nr", "nr.",
    "number", "index", "id", "row", "line", "section", "chapter", "version", "note", "notes", "remark", "remarks", "comment", "comments", "access", "rw",
    "bereich", "grenze", "standard", "standardwert", "wert", "beispiel", "seite", "bemerkung",
];
/// Headings of a number that is divided by ten as often.
const PLACES: [&str; 8] =
    ["decimals", "decimal", "digits", "precision", "dezimalstellen", "nachkommastellen", "kommastellen", "nachkomma"];

/// What is known of one heading.
#[derive(Debug, Clone)]
pub struct Heading(Vec<String>);

impl Heading {
    /// Its words in small letters.
    pub fn new(heading: &str) -> Heading {
        let heading = heading.to_lowercase().replace("r/w", "rw");
        // The marks of Thai are part of a word.
        let is_of_word = |c: char| c.is_alphanumeric() || c == '.' || ('\u{0E31}'..='\u{0E4E}').contains(&c);
        let words = heading.split(|c: char| !is_of_word(c)).filter(|word| !word.is_empty());
        Heading(words.map(str::to_owned).collect())
    }

    /// Has it one of these words?
    pub fn has(&self, known: &[&str]) -> bool {
        self.0.iter().any(|word| known.contains(&word.as_str()))
    }

    /// What it can be, the likeliest first.
    pub fn candidates(&self) -> Vec<Column> {
        let all = HEADINGS.iter().filter(|(_, known)| self.has(known)).map(|(column, _)| *column);
        all.chain(self.is_place().then_some(Column::Address)).collect()
    }

    /// What it is as an export of this program has it, and no word more.
    pub fn exact(heading: &str) -> Option<Column> {
        let heading = heading.trim();
        OWN.iter().find(|(_, word)| heading.eq_ignore_ascii_case(word)).map(|(column, _)| *column)
    }

    /// Nothing in its column matters to how a number is read.
    pub fn is_harmless(&self) -> bool {
        !self.0.is_empty() && self.0.iter().all(|word| HARMLESS.contains(&word.as_str()))
    }

    /// Its column says how many decimals a number has.
    pub fn is_places(&self) -> bool {
        self.has(&PLACES) || matches!(self.0.as_slice(), [word] if word == "dec")
    }

    /// Its column says tables, and nothing else.
    pub fn is_of_tables(&self) -> bool {
        let is_known =
            |word: &String| TABLES.contains(&word.as_str()) || ["modbus", "register", "data"].contains(&word.as_str());
        self.has(&TABLES) && self.0.iter().all(is_known)
    }

    /// Its column can say types.
    pub fn is_of_types(&self) -> bool {
        self.has(&["type", "typ", "tipo", "regtype", "registertype", "registertyp"])
    }

    /// Can words for tables below it be those? A name or a unit may be the same word.
    pub fn may_be_of_tables(&self) -> bool {
        let candidates = self.candidates();
        let may_be =
            |column: &Column| matches!(column, Column::Type | Column::Table | Column::Address | Column::Access);
        candidates.contains(&Column::Table) || candidates.iter().all(may_be)
    }

    /// Digits below it are hexadecimal.
    pub fn is_hex(&self) -> bool {
        let is_hex =
            |word: &String| matches!(word.as_str(), "0x" | "h") || HEX.iter().any(|known| word.contains(known));
        self.0.iter().any(is_hex)
    }

    /// Digits below it are decimal.
    pub fn is_decimal(&self) -> bool {
        self.0.iter().any(|word| DECIMAL.iter().any(|known| word.starts_with(known)))
    }

    /// Its column says the last of several addresses.
    pub fn is_last(&self) -> bool {
        let is_known = |word: &String| LAST.contains(&word.as_str()) || ADDRESS.contains(&word.as_str());
        self.has(&LAST) && self.0.iter().all(is_known)
    }

    /// Its column says where something is written, and not where it is read.
    pub fn is_of_writes(&self) -> bool {
        self.has(&["write", "writing", "schreiben", "schreibadresse"]) && !self.has(&["read", "lesen"])
    }

    /// Its column says where something stands, if no other does.
    pub fn is_place(&self) -> bool {
        matches!(self.0.as_slice(), [word] if ["start", "offset", "from", "von"].contains(&word.as_str()))
    }

    /// Its column says byte orders, or counts rows.
    pub fn is_any_order(&self) -> bool {
        matches!(self.0.as_slice(), [word] if word == "order" || word == "reihenfolge")
    }

    /// Its column says powers of ten, and nothing else.
    pub fn is_power(&self) -> bool {
        self.has(&["exponent", "zehnerpotenz"])
    }

    /// Its column says formats, of types or of decimals.
    pub fn is_format(&self) -> bool {
        self.has(&["format", "dataformat", "datenformat", "formato", "formaat"])
    }

    /// Its column says how exact a number is, which may be its factor as well.
    pub fn is_accuracy(&self) -> bool {
        self.has(&["step", "accuracy", "schrittweite", "genauigkeit"])
    }

    /// Its column multiplies, and never divides.
    pub fn is_multiplier(&self) -> bool {
        self.has(&["multiplier", "multiply", "multiplikator"]) || self.is_resolution()
    }

    /// Its column says what the last digit of a number is worth, perhaps with a unit.
    pub fn is_resolution(&self) -> bool {
        self.has(&["resolution", "auflösung", "résolution", "risoluzione"])
    }

    /// Its column says between which values a number lies.
    pub fn is_of_bounds(&self) -> bool {
        self.has(&["range", "min", "minimum", "wertebereich", "messbereich", "plage", "rango", "диапазон", "范围"])
    }

    /// Makers multiply by such a number as well as they divide by it.
    pub fn is_scale_factor(&self) -> bool {
        self.has(&["scalefactor", "gain"]) || self.has(&["scale"]) && self.has(&["factor"])
    }

    /// How its numbers count, where it says that.
    pub fn base(&self) -> Option<AddressBase> {
        let pair = |first: &[&str]| {
            self.0
                .windows(2)
                .any(|two| first.contains(&two[0].as_str()) && ["based", "basiert"].contains(&two[1].as_str()))
        };
        if pair(&["1", "one"]) {
            return Some(AddressBase::One);
        }
        (pair(&["0", "zero"]) || self.has(&["pdu", "protocol", "wire"])).then_some(AddressBase::Zero)
    }

    /// Its column says function codes, and nothing else.
    pub fn is_of_codes(&self) -> bool {
        self.has(&["fc", "funktionscode", "功能码"])
            || self
                .0
                .windows(2)
                .any(|two| ["function", "func", "funktions"].contains(&two[0].as_str()) && two[1].starts_with("code"))
    }

    /// How sure it is that names stand below it, from 0: a word of names, another one, that of a text about them.
    pub fn rank_of_names(&self) -> usize {
        if self.has(&TEXTS) {
            return 3;
        }
        if self.has(&["meaning", "bedeutung"]) {
            return 2;
        }
        usize::from(self.has(&WEAK_NAMES) && !self.has(&NAMES))
    }

    /// Is it that of a column of addresses, by more than how their digits are written?
    pub fn is_strong_address(&self) -> bool {
        self.is_place() || self.0.iter().any(|word| ADDRESS.contains(&word.as_str()) && !WEAK.contains(&word.as_str()))
    }
}

/// Is it a heading: with an address and one more, and no number? What its reader has said of a column counts.
pub fn is_heading(cells: &[String], said: &Said) -> bool {
    // `rw` stands in rows as well.
    let is_known = |cell: &&String| {
        let by_word = || Heading::new(cell).candidates().iter().any(|column| *column != Column::Access);
        said_of(said, cell).map_or_else(by_word, |means| means.is_some())
    };
    heat_pump::is_of_manager(cells) || has_addresses(cells, said) && 2 <= cells.iter().filter(is_known).count()
}

/// Has it a column of addresses, and no cell that only a row has?
pub fn has_addresses(cells: &[String], said: &Said) -> bool {
    let is_strong = |cell: &String| match said_of(said, cell) {
        Some(means) => matches!(means, Some(Column::Address | Column::HexAddress)),
        None => Heading::new(cell).is_strong_address(),
    };
    let is_of_row =
        |cell: &String| is_address(cell) || is_sized_type(cell) || register_names::number_of(cell).is_some();
    cells.iter().any(is_strong) && !cells.iter().any(is_of_row)
}

/// Is it the heading of an export of this program, as that writes it or with columns taken out?
pub fn is_own(cells: &[String]) -> bool {
    cells.iter().all(|cell| Heading::exact(cell).is_some())
        && cells.iter().any(|cell| Heading::exact(cell) == Some(Column::Bad))
}
