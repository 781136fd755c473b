//! The text of a file as its problems are drawn in it.

use miette::{MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

/// A text for drawing, whose columns count characters as an editor does: miette counts bytes.
pub(super) struct DrawnText {
    pub(super) file: String,
    pub(super) text: String,
}

impl SourceCode for DrawnText {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.read_span(span, before, after)?;
        let start = self.text.get(..span.offset()).unwrap_or("");
        let line = start.rsplit('\n').next().unwrap_or("").chars().count();
        let column = if inner.column() == 0 { 0 } else { line };
        let (data, span, rows) = (inner.data(), *inner.span(), inner.line_count());
        Ok(Box::new(MietteSpanContents::new_named(self.file.clone(), data, span, inner.line(), column, rows)))
    }
}
