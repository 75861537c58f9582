// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace evpose {

// Text to numbers: the whole text must be the number, independent of the locale. False leaves `out` as it
// was.

/// May give nan or infinity where the text says so.
bool parse_number(std::string_view s, double& out);
bool parse_integer(std::string_view s, std::int64_t& out);

/// Decimal text, also with an exponent, to whole units of 10^-decimals, rounded down without passing through
/// a double: ("-1.5", 3) gives -1500, ("1.0000019", 6) gives 1000001. False also when it does not fit.
bool parse_decimal(std::string_view s, int decimals, std::int64_t& out);

/// Parts of a line between its commas, empty ones too; between blanks and tabs where it has no comma.
void split_fields(std::string_view line, std::vector<std::string_view>& fields);

/// Stamps of files are at most this far from zero (year 2065), so that their differences fit 64 bits
/// with any offset.
inline constexpr std::int64_t kLargestTimeNs = 3'000'000'000'000'000'000;

std::string_view trimmed(std::string_view s);
std::string lower_case(std::string_view s);

/// Whole units of 10^-decimals as decimal text: (-1500, 3) gives "-1.500".
std::string format_decimal(std::int64_t value, int decimals);

/// Appends ` value` or `,value` in decimal notation.
void append_number(std::string& line, char separator, double value, int decimals);

}  // namespace evpose
