//! Calculated tags: their values follow from those of other tags, with quality and time.

use super::{
    calculation_def::OverTime,
    def::PlantDef,
    delay::DelayTimer,
    expr::Expr,
    id::TagId,
    redefinition::Redefinition,
    sample::{Cause, Quality, Sample},
    tag::TagDef,
    totalizer::Totalizer,
};

/// It at work, with what it has kept so far.
#[derive(Debug, Clone)]
enum State {
    Total(Totalizer),
    Delay(DelayTimer),
}

impl State {
    fn new(over_time: OverTime) -> State {
        match over_time {
            OverTime::Total(total) => State::Total(Totalizer::new(total)),
            OverTime::Delay(delay) => State::Delay(DelayTimer::new(delay)),
        }
    }

    fn add(&mut self, input: Sample) -> Sample {
        match self {
            State::Total(total) => total.add(input),
            State::Delay(timer) => timer.add(input),
        }
    }
}

/// A calculated tag and those that it needs.
type Inputs = (TagId, Vec<TagId>);

/// A calculated tag, those that it needs, and what it keeps over time.
type Step = (TagId, Vec<TagId>, Option<State>);

/// The calculated tags, each after those that it needs.
#[derive(Debug, Clone, Default)]
pub struct Calculator {
    order: Vec<Step>,
}

impl Calculator {
    /// Of tags without a cycle; those of a cycle are never calculated.
    pub fn new(tags: &[TagDef]) -> Calculator {
        let over_time =
            |tag: TagId| tags[tag.index()].calculation.as_ref().and_then(|calculation| calculation.over_time);
        let step = |(tag, inputs): Inputs| (tag, inputs, over_time(tag).map(State::new));
        Calculator { order: order(tags).0.into_iter().map(step).collect() }
    }

    /// Lets every total go on from its last stored value, or from 0; gives the tags that are totals.
    pub fn restore_totals(&mut self, stored: &[(TagId, f64)]) -> Vec<TagId> {
        let totals = self.order.iter_mut().filter_map(|(tag, _, state)| {
            let Some(State::Total(total)) = state else { return None };
            let value = stored.iter().find(|(stored, _)| stored == tag).map_or(0.0, |(_, value)| *value);
            total.restore(value);
            Some(*tag)
        });
        totals.collect()
    }

    /// Goes on with what calculations have kept that are as they were. A total that is calculated otherwise goes on from its
    /// value, as it does after a restart.
    pub fn redefine(&mut self, before: &mut Calculator, change: &Redefinition) {
        for (tag, _, state) in &mut self.order {
            let step = change.tag(*tag).and_then(|was| before.order.iter_mut().find(|(tag, ..)| *tag == was));
            match (state, step.and_then(|(.., state)| state.take())) {
                (Some(state), Some(was)) if change.source(*tag).is_some() => *state = was,
                (Some(State::Total(total)), Some(State::Total(was))) => total.go_on_from(&was),
                (Some(_) | None, _) => {}
            }
        }
    }

    /// The new samples of all tags that need a `touched` one, themselves or through others.
    pub fn changed(&mut self, def: &PlantDef, touched: &[TagId], samples: &[Sample]) -> Vec<(TagId, Sample)> {
        if self.order.is_empty() || touched.is_empty() {
            return Vec::new();
        }
        let mut samples = samples.to_vec();
        let mut is_changed = vec![false; samples.len()];
        touched.iter().for_each(|tag| is_changed[tag.index()] = true);
        let mut changed = Vec::new();
        for (tag, inputs, state) in &mut self.order {
            let is_due = inputs.iter().any(|input| is_changed[input.index()]) || is_changed[tag.index()];
            if let Some(calculation) = def.tag(*tag).calculation.as_ref().filter(|_| is_due) {
                let at = samples[tag.index()].at;
                let sample =
                    calculate(&calculation.expr, inputs, |of| samples[of.index()], Sample::bad(Cause::NotRead, at));
                let sample = state.as_mut().map_or(sample, |state| state.add(sample));
                (samples[tag.index()], is_changed[tag.index()]) = (sample, true);
                changed.push((*tag, sample));
            }
        }
        changed
    }
}

/// A value is as good as the worst of its inputs, for the cause of the first of these, and as new as the newest. `none` is
/// the sample of an expression without inputs, but for its value.
fn calculate(expr: &Expr, inputs: &[TagId], sample: impl Fn(TagId) -> Sample, none: Sample) -> Sample {
    let at = inputs.iter().map(|input| sample(*input).at).max().unwrap_or(none.at);
    let find = |test: fn(Quality) -> bool| {
        inputs.iter().map(|input| sample(*input).quality).find(|quality| test(*quality)).and_then(Quality::cause)
    };
    if let Some(cause) = find(Quality::is_bad) {
        return Sample::bad(cause, at);
    }
    let Some(value) = expr.number(&|tag| sample(tag).exact()) else { return Sample::bad(Cause::Undefined, at) };
    let good = Sample::good(value, at);
    find(|quality| !quality.is_good()).map_or(good, |cause| good.uncertain(cause))
}

/// The calculated tags in an order in which each stands after its inputs; and the tags of the first cycle, if there is one.
pub fn order(tags: &[TagDef]) -> (Vec<Inputs>, Option<Vec<TagId>>) {
    let mut walk = Walk { tags, seen: vec![false; tags.len()], path: Vec::new(), order: Vec::new(), cycle: None };
    tags.iter().for_each(|tag| walk.visit(tag.id));
    (walk.order, walk.cycle)
}

struct Walk<'a> {
    tags: &'a [TagDef],
    seen: Vec<bool>,
    /// What is being visited, each needed by the one before, with what it needs and how many of these were visited. No call
    /// lies inside another: a chain may be as long as a plant has tags.
    path: Vec<(TagId, Vec<TagId>, usize)>,
    order: Vec<Inputs>,
    cycle: Option<Vec<TagId>>,
}

impl Walk<'_> {
    fn visit(&mut self, tag: TagId) {
        self.begin(tag);
        while let Some((_, inputs, visited)) = self.path.last_mut() {
            let next = inputs.get(*visited).copied();
            *visited += 1;
            match next {
                Some(input) => self.begin(input),
                None => self.order.extend(self.path.pop().map(|(tag, inputs, _)| (tag, inputs))),
            }
        }
    }

    fn begin(&mut self, tag: TagId) {
        let Some(calculation) = self.tags[tag.index()].calculation.as_deref() else { return };
        if !std::mem::replace(&mut self.seen[tag.index()], true) {
            self.path.push((tag, calculation.inputs(), 0));
        } else if let Some(start) = self.path.iter().position(|(on_path, ..)| *on_path == tag) {
            self.cycle.get_or_insert_with(|| self.path[start..].iter().map(|(tag, ..)| *tag).collect());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use jiff::Timestamp;

    use super::*;
    use crate::plant::{
        calculation_def::Calculation,
        expr::Operator,
        fixture::{self, PV, SV},
    };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn arithmetic(left: TagId, operator: Operator, right: TagId) -> Expr {
        Expr::Arithmetic(Box::new(Expr::Tag(left)), operator, Box::new(Expr::Tag(right)))
    }

    /// The fixture with two more tags: twice the second, and before it in the file.
    fn plant() -> (PlantDef, TagId, TagId) {
        let mut def = fixture::plant().clone();
        let count = u16::try_from(def.tags.len()).expect("a small plant");
        let (double, deviation) = (TagId(count), TagId(count + 1));
        let exprs = [arithmetic(deviation, Operator::Add, deviation), arithmetic(PV, Operator::Subtract, SV)];
        for (id, expr) in [double, deviation].into_iter().zip(exprs) {
            let tag = TagDef { id, ..def.tags[PV.index()].clone() };
            def.tags.push(TagDef {
                calculation: Some(Arc::new(Calculation { text: String::new(), over_time: None, expr })),
                ..tag
            });
        }
        (def, double, deviation)
    }

    #[test]
    fn a_calculated_tag_follows_its_inputs_in_their_order() {
        let (def, double, deviation) = plant();
        let mut calculator = Calculator::new(&def.tags);
        let mut samples = vec![Sample::bad(Cause::NotRead, at(0)); def.tags.len()];
        (samples[PV.index()], samples[SV.index()]) = (Sample::good(72.5, at(3)), Sample::good(70.0, at(2)));
        let expect = [(deviation, Sample::good(2.5, at(3))), (double, Sample::good(5.0, at(3)))];
        assert_eq!(calculator.changed(&def, &[PV], &samples), expect);
        assert_eq!(calculator.changed(&def, &[fixture::RUN], &samples), [], "no input of it");
        assert_eq!(calculator.changed(&def, &[], &samples), []);
    }

    #[test]
    fn a_calculated_value_is_as_good_as_its_worst_input() {
        let (good, zero) = (Sample::good(6.0, at(1)), Sample::good(0.0, at(2)));
        let uncertain = zero.uncertain(Cause::Stale);
        let bad = |cause, second| Sample::bad(cause, at(second));
        for (operator, first, second, expect) in [
            (Operator::Add, good, zero, Sample::good(6.0, at(2))),
            (Operator::Add, good, uncertain, Sample::good(6.0, at(2)).uncertain(Cause::Stale)),
            (Operator::Add, uncertain, bad(Cause::Timeout, 3), bad(Cause::Timeout, 3)),
            (Operator::Add, bad(Cause::SensorFault, 4), bad(Cause::Timeout, 3), bad(Cause::SensorFault, 4)),
            (Operator::Divide, good, zero, bad(Cause::Undefined, 2)),
            (Operator::Multiply, Sample::good(f64::MAX, at(1)), good, bad(Cause::Undefined, 1)),
        ] {
            let sample = |tag| if tag == PV { first } else { second };
            let found = calculate(&arithmetic(PV, operator, SV), &[PV, SV], sample, bad(Cause::NotRead, 0));
            assert_eq!(found, expect);
        }
    }

    #[test]
    fn a_cycle_is_found_and_named() {
        let (mut def, double, deviation) = plant();
        assert_eq!(order(&def.tags).1, None);
        let expr = arithmetic(double, Operator::Add, PV);
        def.tags[deviation.index()].calculation =
            Some(Arc::new(Calculation { text: String::new(), over_time: None, expr }));
        assert_eq!(order(&def.tags).1, Some(vec![double, deviation]));
    }

    #[test]
    fn a_chain_may_be_as_long_as_a_plant_has_tags() {
        let mut tags = vec![fixture::plant().tags[0].clone(); 20_000];
        for (n, tag) in (0..).zip(&mut tags) {
            let expr = Expr::Tag(TagId((n + 1) % 20_000));
            tag.id = TagId(n);
            tag.calculation = Some(Arc::new(Calculation { text: String::new(), over_time: None, expr }));
        }
        assert_eq!(
            order(&tags).1.map(|cycle| cycle.len()),
            Some(20_000),
            "each needs the next, the last one the first"
        );
        tags[19_999].calculation = None;
        let (found, cycle) = order(&tags);
        assert_eq!((found.len(), found[0].0, found[19_998].0, cycle), (19_999, TagId(19_998), TagId(0), None));
    }
}
