//! Tables of a report as Parquet, for programs that compute: columns by their English names, numbers as they are printed, instants
//! in UTC; what else the report says of its period stands as key and value in the file.

use std::sync::Arc;

use parquet::{
    basic::{LogicalType, Repetition, TimeUnit, Type as Physical},
    data_type::{ByteArray, ByteArrayType, DoubleType, FixedLenByteArray, FixedLenByteArrayType, Int64Type},
    errors::ParquetError,
    file::{
        metadata::KeyValue,
        properties::WriterProperties,
        writer::{SerializedColumnWriter, SerializedFileWriter},
    },
    schema::types::Type,
};

use super::{
    ReportFormat, Style,
    csv::iso,
    document::{Cell, Column, ColumnKind, Content, Document, Fact, Table},
};
use crate::plant::{def::Section as Kind, exact::digits};

/// The format `parquet`.
#[derive(Debug)]
pub struct Parquet;

impl ReportFormat for Parquet {
    fn name(&self) -> &'static str {
        "parquet"
    }
    fn about(&self) -> &'static str {
        "the table of values, for programs that compute"
    }

    fn extension(&self) -> &'static str {
        "parquet"
    }

    /// A file holds one table: that of the values.
    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String> {
        let values = self.tables(document, style)?.into_iter().find(|(word, _)| *word == Kind::Values.word());
        values.map(|(_, bytes)| bytes).ok_or_else(|| {
            "Parquet has the table of values, and this report has none: see sections and tags of [report]".to_owned()
        })
    }

    fn tables(&self, document: &Document, _style: &Style) -> Result<Vec<(&'static str, Vec<u8>)>, String> {
        let tables = document.sections.iter().filter_map(|section| match &section.content {
            Content::Table(table) => Some((section.kind.word(), table)),
            Content::Facts(_) | Content::Charts(_) | Content::Signatures(_) => None,
        });
        let file = |(word, rows): (&'static str, &Table)| {
            table(document, rows).map(|bytes| (word, bytes)).map_err(|error| error.to_string())
        };
        tables.map(file).collect()
    }
}

fn table(document: &Document, table: &Table) -> Result<Vec<u8>, ParquetError> {
    let cells = |place: usize| table.rows.iter().map(move |row| &row[place]);
    // A column whose numbers a DOUBLE would round has another one with all their digits.
    let has_rests = |place: &usize| cells(*place).any(|cell| exact(cell).is_some());
    let rests: Vec<usize> = (0..table.columns.len()).filter(has_rests).collect();
    let fields = table.columns.iter().map(|column| field(column).map(Arc::new));
    let exacts = rests.iter().map(|place| exact_field(&table.columns[*place]).map(Arc::new));
    let fields = fields.chain(exacts).collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("report").with_fields(fields).build()?;
    let properties = WriterProperties::builder()
        .set_created_by(concat!("sightglass ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(about(document)));
    let mut file = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties.build()))?;
    let mut group = file.next_row_group()?;
    for (place, column) in table.columns.iter().enumerate() {
        if let Some(mut writer) = group.next_column()? {
            write(&mut writer, column.kind, cells(place))?;
            writer.close()?;
        }
    }
    for place in rests {
        if let Some(mut writer) = group.next_column()? {
            let (values, levels) = split(cells(place), exact);
            writer.typed::<FixedLenByteArrayType>().write_batch(&values, Some(&levels), None)?;
            writer.close()?;
        }
    }
    group.close()?;
    file.into_inner()
}

/// Any cell may be empty.
fn field(column: &Column) -> Result<Type, ParquetError> {
    let (physical, logical) = match column.kind {
        ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        ColumnKind::Number => (Physical::DOUBLE, None),
        ColumnKind::Time | ColumnKind::Milliseconds => {
            let logical = LogicalType::Timestamp { is_adjusted_to_u_t_c: true, unit: TimeUnit::MICROS };
            (Physical::INT64, Some(logical))
        }
    };
    Type::primitive_type_builder(&column.id, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()
}

/// Decimals of a number with all its digits, and digits and bytes of its type.
const EXACT: (i32, i32, i32) = (6, 38, 16);

fn exact_field(column: &Column) -> Result<Type, ParquetError> {
    let (scale, precision, bytes) = EXACT;
    Type::primitive_type_builder(&format!("{}_exact", column.id), Physical::FIXED_LEN_BYTE_ARRAY)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(Some(LogicalType::Decimal { scale, precision }))
        .with_scale(scale)
        .with_precision(precision)
        .with_length(bytes)
        .build()
}

/// All digits of a number that has more than a DOUBLE keeps.
fn exact(cell: &Cell) -> Option<FixedLenByteArray> {
    let Cell::Number(number, decimals) = cell else { return None };
    let scale = EXACT.0.unsigned_abs();
    let printed = decimals.map_or(scale, u32::from).min(scale);
    let mantissa = number.rest().and_then(|_| number.mantissa(printed))?;
    let mantissa = mantissa.checked_mul(10i128.pow(scale - printed))?;
    Some(ByteArray::from(mantissa.to_be_bytes().to_vec()).into())
}

/// The cells of a column; one of another kind than its column would be empty.
fn write<'a>(
    writer: &mut SerializedColumnWriter,
    kind: ColumnKind,
    cells: impl Iterator<Item = &'a Cell> + Clone,
) -> Result<usize, ParquetError> {
    match kind {
        ColumnKind::Text => {
            let (values, levels) = split(cells, |cell| match cell {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                Cell::Empty | Cell::Number(..) | Cell::Time(_) => None,
            });
            writer.typed::<ByteArrayType>().write_batch(&values, Some(&levels), None)
        }
        ColumnKind::Number => {
            let (values, levels) = split(cells, |cell| match cell {
                Cell::Number(value, decimals) => {
                    value.as_f64().and_then(|_| digits(*value, *decimals).parse::<f64>().ok())
                }
                Cell::Empty | Cell::Text(_) | Cell::Time(_) => None,
            });
            writer.typed::<DoubleType>().write_batch(&values, Some(&levels), None)
        }
        ColumnKind::Time | ColumnKind::Milliseconds => {
            let (values, levels) = split(cells, |cell| match cell {
                Cell::Time(at) => Some(at.as_microsecond()),
                Cell::Empty | Cell::Text(_) | Cell::Number(..) => None,
            });
            writer.typed::<Int64Type>().write_batch(&values, Some(&levels), None)
        }
    }
}

/// Values that are there, and for each cell whether it has one (1) or is empty (0).
fn split<'a, T>(cells: impl Iterator<Item = &'a Cell>, value: impl Fn(&Cell) -> Option<T>) -> (Vec<T>, Vec<i16>) {
    let cells: Vec<Option<T>> = cells.map(value).collect();
    let levels = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    (cells.into_iter().flatten().collect(), levels)
}

/// Plant, period and provenance.
fn about(document: &Document) -> Vec<KeyValue> {
    let word = |cell: &Cell| match cell {
        Cell::Empty => None,
        Cell::Text(text) => Some(text.clone()),
        Cell::Number(value, decimals) => Some(digits(*value, *decimals)),
        Cell::Time(at) => Some(iso(&document.zone, *at)),
    };
    let facts = document.sections.iter().flat_map(|section| match &section.content {
        Content::Facts(facts) => facts.as_slice(),
        Content::Table(_) | Content::Charts(_) | Content::Signatures(_) => &[],
    });
    let fact = |Fact { id, cell, .. }: &Fact| KeyValue::new((*id).to_owned(), word(cell));
    let heading = KeyValue::new("heading".to_owned(), document.heading.clone());
    std::iter::once(heading).chain(facts.map(fact)).collect()
}

#[cfg(test)]
mod tests {
    use ::parquet::{
        file::reader::{FileReader, SerializedFileReader},
        record::Field,
    };

    use super::*;
    use crate::{
        report::{
            ShiftReport,
            content::document,
            testing::{THREE, plant, shift_report},
        },
        text::Locale,
    };

    /// The rows of a table, and the keys of its file with their values.
    fn read(word: &str) -> (Vec<Vec<(String, Field)>>, Vec<KeyValue>) {
        read_of(&shift_report(), word)
    }

    fn read_of(report: &ShiftReport, word: &str) -> (Vec<Vec<(String, Field)>>, Vec<KeyValue>) {
        let def = plant("Asia/Bangkok", &THREE);
        let document = document(report, &def, Locale::ENGLISH);
        let tables = Parquet.tables(&document, &Style::of(&def)).expect("it can be made");
        let (_, bytes) = tables.into_iter().find(|(name, _)| *name == word).expect("the table");
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).expect("Parquet");
        let keys = reader.metadata().file_metadata().key_value_metadata().cloned().unwrap_or_default();
        let rows = reader.get_row_iter(None).expect("rows").map(|row| row.expect("a row"));
        (rows.map(|row| row.into_columns()).collect(), keys)
    }

    fn cell(row: &[(String, Field)], column: &str) -> Field {
        let cell = row.iter().find(|(name, _)| name == column).expect("the column");
        cell.1.clone()
    }

    #[test]
    fn values_are_numbers_and_what_is_missing_is_null() {
        let (rows, keys) = read("values");
        assert_eq!(cell(&rows[0], "tag"), Field::Str("TIC-1.PV".to_owned()));
        assert_eq!((cell(&rows[0], "mean"), cell(&rows[0], "max")), (Field::Double(54.32), Field::Double(71.2)));
        assert_eq!(cell(&rows[1], "min"), Field::Null);
        let value = |key: &str| keys.iter().find(|pair| pair.key == key).and_then(|pair| pair.value.clone());
        assert_eq!(value("from").as_deref(), Some("2026-11-21T06:00:00+07:00"));
        assert_eq!(value("program").as_deref(), Some(concat!("sightglass ", env!("CARGO_PKG_VERSION"))));
    }

    #[test]
    fn what_a_double_rounds_stands_in_a_decimal_beside_it() {
        let mut report = shift_report();
        (report.tags[2].last, report.tags[2].decimals) = ("18446744073709551.615".parse().ok(), 3);
        let (rows, _) = read_of(&report, "values");
        let Field::Decimal(decimal) = cell(&rows[2], "last_exact") else { panic!("{:?}", rows[2]) };
        let digits = decimal.data().iter().fold(0_i128, |digits, byte| digits << 8 | i128::from(*byte));
        assert_eq!((digits, decimal.scale()), (18_446_744_073_709_551_615_000, 6));
        assert_eq!((cell(&rows[2], "last"), cell(&rows[0], "last_exact")), (Field::Null, Field::Null));
        assert!(
            rows[0].iter().all(|(name, _)| name != "first_exact"),
            "a column only where it is needed: {:?}",
            rows[0]
        );
    }

    #[test]
    fn instants_are_in_utc_with_milliseconds() {
        let (rows, _) = read("alarms");
        let at = "2026-11-21T06:12:45.500+07:00".parse::<jiff::Timestamp>().expect("an instant");
        assert_eq!(cell(&rows[0], "time"), Field::TimestampMicros(at.as_microsecond()));
    }

    #[test]
    fn a_report_without_values_is_refused() {
        let mut def = plant("Asia/Bangkok", &THREE);
        def.report.sections = vec![Kind::Alarms];
        let made = document(&shift_report(), &def, Locale::ENGLISH);
        assert!(Parquet.render(&made, &Style::of(&def)).is_err_and(|why| why.contains("table of values")));
    }
}
