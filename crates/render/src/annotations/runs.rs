//! Masks as runs of pixels down the columns, and COCO's text of them.
//!
//! COCO writes the lengths of runs of pixels outside and inside in turn, from the top of the first column on, each from
//! the third on less the one two before it, in groups of five bits from the lowest, six to a character from `0` on, of
//! which the sixth says that more follow: `rleToString` of its reference implementation.

use serde::{Deserialize, Serialize};

/// A mask: `size` and `counts` as COCO has them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mask {
    /// Rows and columns.
    pub size: [u32; 2],
    /// The runs.
    pub counts: String,
}

/// A mask while it is made: pixels are added down the columns, from the first column on.
#[derive(Debug, Clone, Default)]
pub(super) struct RunLengths {
    /// The first pixel and the one behind the last of each.
    runs: Vec<[u32; 2]>,
}

impl RunLengths {
    /// Adds the pixel of this number, down the columns; greater than all before it.
    pub(super) fn push(&mut self, pixel: u32) {
        match self.runs.last_mut() {
            Some([_, end]) if *end == pixel => *end += 1,
            _ => self.runs.push([pixel, pixel + 1]),
        }
    }

    /// As a mask of so many rows and columns.
    pub(super) fn mask(&self, [rows, columns]: [u32; 2]) -> Mask {
        let mut lengths = Vec::with_capacity(2 * self.runs.len() + 1);
        let mut at = 0;
        for [start, end] in &self.runs {
            lengths.extend([start - at, end - start]);
            at = *end;
        }
        let all = rows * columns;
        if at < all {
            lengths.push(all - at);
        }
        Mask { size: [rows, columns], counts: text_of(&lengths) }
    }
}

impl Mask {
    /// The lengths of runs outside and inside in turn; those of a text that is none end where it goes wrong.
    fn lengths(&self) -> Vec<u32> {
        let mut lengths: Vec<i64> = Vec::new();
        let mut digits = self.counts.bytes();
        while digits.len() > 0 {
            let (mut value, mut shift) = (0_i64, 0);
            while let Some(digit) = digits.next().map(|byte| i64::from(byte) - 48) {
                if shift < 60 {
                    value |= (digit & 0x1f) << shift;
                }
                shift += 5;
                if digit & 0x20 == 0 {
                    if digit & 0x10 != 0 && shift < 60 {
                        value |= -1 << shift;
                    }
                    break;
                }
            }
            if let Some(before) = lengths.len().checked_sub(2).filter(|_| lengths.len() > 2) {
                value = value.saturating_add(lengths[before]);
            }
            lengths.push(value);
        }
        lengths.into_iter().map_while(|length| u32::try_from(length).ok()).collect()
    }

    /// The runs inside, first pixel and the one behind the last, down the columns.
    fn runs(&self) -> Vec<[u32; 2]> {
        let all = self.size[0].saturating_mul(self.size[1]);
        let mut at = 0_u32;
        let mut runs = Vec::new();
        for (k, length) in self.lengths().into_iter().enumerate() {
            let end = at.saturating_add(length).min(all);
            if k % 2 == 1 && end > at {
                runs.push([at, end]);
            }
            at = end;
        }
        runs
    }

    /// Number of pixels of the mask.
    #[must_use]
    pub fn area(&self) -> u32 {
        self.runs().iter().map(|[start, end]| end - start).sum()
    }

    /// The box around it as COCO has it: the least column and row, and how many columns and rows; all 0 where it is
    /// empty.
    #[must_use]
    pub fn bounds(&self) -> [u32; 4] {
        let rows = self.size[0].max(1);
        let (mut least, mut most) = ([u32::MAX; 2], [0; 2]);
        for [start, end] in self.runs() {
            let (first, last) =
                ([start / rows, start % rows], [(end - 1) / rows, (end - 1) % rows]);
            // A run over the end of a column has the column's last row and the next one's first.
            let is_whole = first[0] != last[0];
            let top = if is_whole { 0 } else { first[1] };
            let bottom = if is_whole { rows - 1 } else { last[1] };
            least = [least[0].min(first[0]), least[1].min(top)];
            most = [most[0].max(last[0]), most[1].max(bottom)];
        }
        match least[0] {
            u32::MAX => [0; 4],
            _ => [least[0], least[1], most[0] - least[0] + 1, most[1] - least[1] + 1],
        }
    }

    /// A byte a pixel, row by row: 255 inside.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let [rows, columns] = self.size.map(|side| side as usize);
        let mut bytes = vec![0; rows * columns];
        for [start, end] in self.runs() {
            for pixel in start as usize..end as usize {
                bytes[pixel % rows * columns + pixel / rows] = 255;
            }
        }
        bytes
    }
}

fn text_of(lengths: &[u32]) -> String {
    let mut text = String::new();
    for (k, &length) in lengths.iter().enumerate() {
        let mut left = i64::from(length);
        if k > 2 {
            left -= i64::from(lengths[k - 2]);
        }
        loop {
            let digit = (left & 0x1f) as u8;
            left >>= 5;
            let is_last = if digit & 0x10 == 0 { left == 0 } else { left == -1 };
            text.push(char::from(48 + if is_last { digit } else { digit | 0x20 }));
            if is_last {
                break;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(size: [u32; 2], pixels: &[u32]) -> Mask {
        let mut runs = RunLengths::default();
        pixels.iter().for_each(|&pixel| runs.push(pixel));
        runs.mask(size)
    }

    #[test]
    fn texts_are_those_of_the_reference_implementation() {
        // By pycocotools 2.0.11: encode of zeros, of ones, and of a square of 2 in 5 rows and 7 columns.
        assert_eq!(mask([5, 7], &[]).counts, "S1");
        assert_eq!(mask([5, 7], &(0..35).collect::<Vec<_>>()).counts, "0S1");
        assert_eq!(mask([5, 7], &[11, 12, 16, 17]).counts, ";230>");
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut state = 9_u32;
        for size in [[1, 1], [7, 5], [61, 40]] {
            let pixels: Vec<u32> = (0..size[0] * size[1])
                .filter(|_| {
                    state = state.wrapping_mul(0x0019_660d).wrapping_add(0x3c6e_f35f);
                    state >> 24 < 90
                })
                .collect();
            let mask = mask(size, &pixels);
            let bytes = mask.bytes();
            let at = |pixel: u32| (pixel % size[0] * size[1] + pixel / size[0]) as usize;
            assert!(pixels.iter().all(|&pixel| bytes[at(pixel)] == 255));
            assert_eq!(bytes.iter().filter(|byte| **byte > 0).count(), pixels.len());
            assert_eq!(mask.area() as usize, pixels.len());
        }
    }

    #[test]
    fn boxes_are_around_all_pixels() {
        assert_eq!(mask([5, 7], &[11, 12, 16, 17]).bounds(), [2, 1, 2, 2]);
        // One run from the bottom of a column to the top of the next.
        assert_eq!(mask([5, 7], &[4, 5]).bounds(), [0, 0, 2, 5]);
        assert_eq!(mask([5, 7], &[]).bounds(), [0; 4]);
    }

    #[test]
    fn texts_that_are_none_end() {
        for counts in ["", "~~~~~~~~~~~~~~~~~~~~", "\u{7f}", "///", "oooooooooo"] {
            let mask = Mask { size: [3, 4], counts: counts.to_owned() };
            assert!(mask.area() <= 12);
        }
    }
}
