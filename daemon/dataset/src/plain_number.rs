//! Numbers as most recorders write them: a sign, digits and a decimal mark.

/// The powers of ten that a double holds exactly and a fraction of digits may need.
const POWERS_OF_TEN: [f64; 20] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19,
];
/// The greatest whole number below which a double holds them all.
const EXACT_MAX: u64 = 1 << 53;

/// How many bytes of a text are a sign, digits and a decimal mark, and the number that they write; `None`
/// where they write none, or one that takes more than a division to round as [`f64::from_str`] does.
///
/// Both the digits as a whole number and the power of ten below it are exact, so that the one
/// division rounds once, to the nearest double.
///
/// [`f64::from_str`]: std::str::FromStr
#[inline]
pub(super) fn plain_number(text: &[u8], decimal: u8) -> (usize, Option<f64>) {
    let is_negative = text.first() == Some(&b'-');
    let signed = usize::from(is_negative || text.first() == Some(&b'+'));
    let (mut at, mut mantissa) = (signed, 0_u64);
    let mut digits = |mut at: usize| {
        while let Some(digit) =
            text.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|it| *it < 10)
        {
            // Of more digits than it holds, which are counted below, it is not used.
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        at
    };
    at = digits(at);
    let (mut count, mut decimals) = (at - signed, 0);
    if text.get(at) == Some(&decimal) {
        let from = at + 1;
        at = digits(from);
        decimals = at - from;
        count += decimals;
    }
    if count == 0 || count >= POWERS_OF_TEN.len() || mantissa > EXACT_MAX {
        return (at, None);
    }
    let size = mantissa as f64 / POWERS_OF_TEN[decimals];
    (at, Some(if is_negative { -size } else { size }))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The same bits as the standard library's, or none where more than a number stands there.
    fn agrees(text: &str) -> Result<(), TestCaseError> {
        let (length, number) = plain_number(text.as_bytes(), b'.');
        prop_assert!(length <= text.len());
        if let Some(number) = number {
            let expected: f64 = text[..length].parse().unwrap();
            prop_assert_eq!(number.to_bits(), expected.to_bits(), "{}", text);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn plain_numbers_are_those_of_the_standard_library(text in "[-+]?[0-9]{0,19}[.]?[0-9]{0,19}[e,x]?[0-9]{0,2}") {
            agrees(&text)?;
        }

        #[test]
        fn numbers_as_programs_write_them_are_read_back(number: f64, few in -1e7..1e7_f64, decimals in 0..9_usize) {
            agrees(&number.to_string())?;
            agrees(&format!("{few:.decimals$}"))?;
        }
    }

    #[test]
    fn what_is_usual_is_plain_and_all_else_is_left_to_others() {
        let read = |text: &str| plain_number(text.as_bytes(), b'.');
        assert_eq!(read("-12.50;7"), (6, Some(-12.5)));
        assert_eq!(read(".5"), (2, Some(0.5)));
        assert_eq!(read("5."), (2, Some(5.0)));
        assert_eq!(read("-0").1.map(f64::to_bits), Some((-0.0_f64).to_bits()));
        assert_eq!(read("9007199254740992").1, Some(9_007_199_254_740_992.0));
        for other in [
            "",
            "-",
            ".",
            "+.",
            "nan",
            "9007199254740993",
            "18446744073709551616",
            "00000000000000000001",
        ] {
            assert_eq!(read(other).1, None, "{other}");
        }
        assert_eq!(plain_number(b"1,5", b','), (3, Some(1.5)));
    }
}
