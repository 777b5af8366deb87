//! A formula has the value that its text promises, its derivative is that of a difference quotient, and every error
//! points at the part that is wrong.

use stylet_formula::{Formula, Unit, solve_unknown_units};

const NAMES: [&str; 6] = ["v", "z", "k", "v0", "elastic", "t"];
const VALUES: [f64; 6] = [-0.003, 0.012, 5.0, 0.01, 0.7, 2.5];

fn units() -> Vec<Unit> {
    ["m/s", "m", "N/m", "m/s", "N", "s"].iter().map(|u| Unit::parse(u).expect("a unit")).collect()
}

fn value(text: &str) -> f64 {
    Formula::parse(text, &NAMES).expect(text).program().evaluate(&VALUES)
}

#[test]
fn precedence_is_that_of_mathematics() {
    for (text, expected) in [
        ("-2^2", -4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("1 - 2 - 3", -4.0),
        ("8/4/2", 1.0),
        ("2 + 3*4", 14.0),
        ("--3", 3.0),
        ("-(-3)", 3.0),
        ("max(0, min(4, 2))", 2.0),
        ("max(max(1, 5), max(2, 9)) + 1", 10.0),
        ("if(1 < 2, 3, 4)", 3.0),
        ("if(z > 0, 1, log(-1))", 1.0),
        ("1e-5*2", 2e-5),
        ("pow(2, 10)", 1024.0),
        ("sign(v) * 2", -2.0),
        ("sgn(v)", -1.0),
        ("2*pi", core::f64::consts::TAU),
    ] {
        assert!(
            (value(text) - expected).abs() < 1e-15 * expected.abs().max(1.0),
            "{text} is {}",
            value(text)
        );
    }
    let expected = 5.0 * 0.012 * libm::log(1.0 + 0.003 / 0.01);
    assert!((value("k * max(0, z) * log(1 + abs(v)/v0)") - expected).abs() < 1e-17);
}

#[test]
fn derivatives_are_those_of_difference_quotients() {
    for text in [
        "k*z*exp(-z/0.1)",
        "sqrt(z)*sin(z) + cos(3*z)/z - atan(z)",
        "tanh(z*20)^2 + z^1.7 + z^3",
        "max(z, 0.1*t*z) + min(z, 0.5) + abs(-z)",
        "if(z > 0, z*z, 0)",
        "-z/(1 + z)",
        "2^(3*z) + log(z)",
    ] {
        let formula = Formula::parse(text, &NAMES).expect("a formula");
        let at = |dz: f64| {
            let mut values = VALUES;
            values[1] += dz;
            formula.program().evaluate(&values)
        };
        let (here, slope) = formula.program().evaluate_with_derivative(&VALUES, 1);
        let expected = (at(1e-6) - at(-1e-6)) / 2e-6;
        assert_eq!(here, at(0.0), "{text}");
        assert!((slope - expected).abs() < 1e-6 * expected.abs().max(1.0), "{text}: {slope} {expected}");
    }
}

#[test]
fn an_error_points_at_the_part_that_is_wrong() {
    for (text, part, says) in [
        ("k * max(0, z) + v", "v", "this has m/s, and what it is combined with has N"),
        ("k * z + elastic * t", "elastic * t", "N s"),
        ("k * z * log(v)", "v", "must have no unit, and this has m/s"),
        ("elastic * z", "elastic * z", "the formula has N m, and N is expected"),
        ("elastic + 0.3", "0.3", "a number has no unit"),
        ("elastic * sgn(z)", "z", "`sgn` takes a velocity"),
        ("elastic * v^k", "k", "an exponent must have no unit"),
        ("elastic * (v/v0 + t)", "t", "this has s"),
        ("k * zz", "zz", "`zz` is not known"),
        ("k * (z", "(", "never closed"),
        ("k * z)", ")", "never opened"),
        ("k z", "z", "operator is missing"),
        ("max(z)", "max(z)", "takes 2 arguments, not 1"),
        ("k * log", "log", "write `log(...)`"),
        ("k * é", "é", "no meaning"),
        ("k * 1..2", "1..2", "no number"),
        ("k *", "", "ends where a value is expected"),
        ("k * * z", "*", "a value is expected"),
        ("(k, z)", ",", "comma"),
        ("if(v, elastic, elastic)", "v", "comparison"),
    ] {
        let error = match Formula::parse(text, &NAMES) {
            Err(error) => error,
            Ok(formula) => formula.expect_unit(&units(), Unit::NEWTON).expect_err("an error"),
        };
        assert_eq!(error.part(text), part, "{text}: {error}");
        assert!(error.message.contains(says), "{text}: {error}");
    }
}

#[test]
fn zero_fits_every_unit_and_roots_halve_exponents() {
    for text in
        ["max(0, k*z)", "k*sqrt(z*z)", "if(z > 0, elastic, 0)", "0", "elastic*(v/v0)^0.7", "0*z + elastic"]
    {
        let formula = Formula::parse(text, &NAMES).expect("a formula");
        formula.expect_unit(&units(), Unit::NEWTON).expect(text);
    }
    for text in ["N s/m^2", "N/(m s)", "1/m", "", "kg", "m/s²", "N/m·s"] {
        let unit = Unit::parse(text).expect(text);
        assert_eq!(
            Unit::parse(&unit.to_string()).ok().filter(|_| unit != Unit::NONE),
            (unit != Unit::NONE).then_some(unit),
            "{text}"
        );
    }
    assert!(Unit::parse("mm").expect_err("a prefix").contains("SI units"));
}

#[test]
fn the_units_of_states_follow_from_the_equations() {
    let names = ["elastic", "v", "tau", "q", "w"];
    let known: Vec<Unit> = ["N", "m/s", "s"].iter().map(|u| Unit::parse(u).expect("a unit")).collect();
    let parse = |text| Formula::parse(text, &names).expect("a formula");
    let (force, q, w) = (parse("-q + elastic*w/tau"), parse("(elastic - q)/tau"), parse("1 - w/tau"));
    let per_second = Unit::SECOND.power(-1.0);
    let required = [(&force, Unit::NEWTON, None), (&q, per_second, Some(0)), (&w, per_second, Some(1))];
    assert_eq!(solve_unknown_units(&required, &known, 2), Ok(vec![Unit::NEWTON, Unit::SECOND]));
    // A state that is a length cannot be added to a force.
    let (force, q) = (parse("elastic - q"), parse("v - q/tau"));
    let required = [(&force, Unit::NEWTON, None), (&q, per_second, Some(0))];
    let (index, error) = solve_unknown_units(&required, &known, 1).expect_err("an error").expect("a place");
    assert!(index == 1 && error.message.contains("N"), "{error}");
    let (force, q) = (parse("elastic"), parse("-q/tau"));
    let required = [(&force, Unit::NEWTON, None), (&q, per_second, Some(0))];
    assert_eq!(solve_unknown_units(&required, &known, 1), Err(None));
}
