// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/exact_utilization.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

namespace redag::analysis {
namespace {

constexpr Uint128 kOne = Uint128{1} << 60U;
constexpr Uint128 kMuch = Uint128{1} << 100U;  // sums stop here, far above every limit
constexpr Int128 kRounding = 1024;             // the rounding error of liu_layland_limit(), in units of 2^-60
constexpr std::size_t kMostBits = 1U << 18U;

// A non-negative whole number of any length. Limbs have 32 bits, the lowest first; the highest is not 0.
class Natural {
 public:
  explicit Natural(Uint128 value) {
    for (; value > 0; value >>= 32U) limbs_.push_back(static_cast<std::uint32_t>(value));
  }

  [[nodiscard]] std::size_t bits() const { return limbs_.size() * 32; }

  friend Natural operator*(const Natural &a, const Natural &b) {
    Natural result(0);
    result.limbs_.assign(a.limbs_.size() + b.limbs_.size(), 0);
    for (std::size_t i = 0; i < a.limbs_.size(); ++i) {
      std::uint64_t carry = 0;
      for (std::size_t j = 0; j < b.limbs_.size(); ++j) {
        carry += std::uint64_t{a.limbs_[i]} * b.limbs_[j] + result.limbs_[i + j];
        result.limbs_[i + j] = static_cast<std::uint32_t>(carry);
        carry >>= 32U;
      }
      result.limbs_[i + b.limbs_.size()] = static_cast<std::uint32_t>(carry);
    }
    result.trim();
    return result;
  }

  friend Natural operator+(const Natural &a, const Natural &b) {
    Natural result(0);
    std::uint64_t carry = 0;
    for (std::size_t i = 0; i < std::max(a.limbs_.size(), b.limbs_.size()) || carry > 0; ++i) {
      carry += (i < a.limbs_.size() ? a.limbs_[i] : 0ULL) + (i < b.limbs_.size() ? b.limbs_[i] : 0ULL);
      result.limbs_.push_back(static_cast<std::uint32_t>(carry));
      carry >>= 32U;
    }
    return result;
  }

  // Returns the quotient and sets `remainder`.
  [[nodiscard]] Natural divided_by(std::uint64_t divisor, std::uint64_t &remainder) const {
    Natural result(0);
    result.limbs_.assign(limbs_.size(), 0);
    remainder = 0;
    for (std::size_t i = limbs_.size(); i-- > 0;) {
      const Uint128 value = (Uint128{remainder} << 32U) + limbs_[i];
      result.limbs_[i] = static_cast<std::uint32_t>(value / divisor);
      remainder = static_cast<std::uint64_t>(value % divisor);
    }
    result.trim();
    return result;
  }

  [[nodiscard]] bool is_at_most(const Natural &other) const {
    if (limbs_.size() != other.limbs_.size()) return limbs_.size() < other.limbs_.size();
    for (std::size_t i = limbs_.size(); i-- > 0;) {
      if (limbs_[i] != other.limbs_[i]) return limbs_[i] < other.limbs_[i];
    }
    return true;
  }

 private:
  void trim() {
    while (!limbs_.empty() && limbs_.back() == 0) limbs_.pop_back();
  }

  std::vector<std::uint32_t> limbs_;
};

Natural power(Natural base, std::size_t exponent) {
  Natural result(1);
  for (; exponent > 0; exponent /= 2) {
    if (exponent % 2 == 1) result = result * base;
    if (exponent > 1) base = base * base;
  }
  return result;
}

ShareRange range_of(const Share &share) {
  const auto period = static_cast<Uint128>(share.period);
  const Uint128 whole = share.amount / period;
  if (whole >= kMuch / kOne) return {kMuch, kMuch};
  const Uint128 rest = share.amount % period * kOne;
  const Uint128 low = whole * kOne + rest / period;
  return {low, low + (rest % period != 0 ? 1 : 0)};
}

struct Fraction {
  Natural numerator{0};
  Natural denominator{1};
};

// The sum over the least common multiple of the periods; empty if that number is too long.
std::optional<Fraction> fraction_of(std::span<const Share> shares) {
  Fraction sum;
  for (const Share &share : shares) {
    const auto period = static_cast<std::uint64_t>(share.period);
    std::uint64_t rest = 0;
    (void)sum.denominator.divided_by(period, rest);
    const Natural factor(period / std::gcd(period, rest));
    sum.denominator = sum.denominator * factor;
    sum.numerator = sum.numerator * factor + Natural(share.amount) * sum.denominator.divided_by(period, rest);
    if (sum.denominator.bits() > kMostBits) return std::nullopt;
  }
  return sum;
}

Uint128 gcd(Uint128 a, Uint128 b) {
  while (b != 0) {
    a %= b;
    std::swap(a, b);
  }
  return a;
}

}  // namespace

void Shares::push(const Share &share) {
  const ShareRange each = range_of(share);
  const ShareRange sum = sums_.back();
  ShareRange product = products_.back();
  // Above 2 the exact product does not matter. Below the cut both factors are below 2^63, and their product fits.
  constexpr Uint128 kMost = 4 * kOne;
  if (each.high > kMost || product.high > kMost) {
    product = {each.low > kMost || product.low > kMost ? 8 * kOne : product.low, 8 * kOne};
  } else {
    const Uint128 high = product.high * (kOne + each.high);
    product = {product.low * (kOne + each.low) / kOne, high / kOne + (high % kOne != 0 ? 1 : 0)};
  }
  all_.push_back(share);
  sums_.push_back({std::min(kMuch, sum.low + each.low), std::min(kMuch, sum.high + each.high)});
  products_.push_back(product);
}

void Shares::pop() {
  all_.pop_back();
  sums_.pop_back();
  products_.pop_back();
}

Int128 liu_layland_limit(std::size_t n) {
  if (n <= 1) return static_cast<Int128>(kOne);
  // long double has 64 bits, and its functions are correct to a few of the last ones.
  const auto count = static_cast<long double>(n);
  const long double limit = count * std::expm1(std::log(2.0L) / count);
  return static_cast<Int128>(limit * static_cast<long double>(kOne)) - kRounding;
}

bool is_sum_within(const Shares &shares, std::uint64_t limit, std::uint64_t of) {
  const ShareRange sum = shares.sum();
  const ShareRange most = range_of(Share{limit, static_cast<Duration>(of)});
  if (sum.high <= most.low) return true;
  if (sum.low > most.high) return false;
  const std::optional<Fraction> exact = fraction_of(shares.all());
  return exact && (exact->numerator * Natural(of)).is_at_most(exact->denominator * Natural(limit));
}

bool is_within_liu_layland(const Shares &shares, std::size_t n) {
  if (n <= 1) return is_sum_within(shares, 1, 1);
  const ShareRange sum = shares.sum();
  const Int128 limit = liu_layland_limit(n);
  if (sum.high <= static_cast<Uint128>(limit)) return true;
  if (sum.low > static_cast<Uint128>(limit + 2 * kRounding)) return false;
  const std::optional<Fraction> exact = fraction_of(shares.all());
  if (!exact || (exact->denominator.bits() + 64) * n > kMostBits) return false;
  const Natural scaled = exact->denominator * Natural(n);
  return power(scaled + exact->numerator, n).is_at_most(Natural(2) * power(scaled, n));
}

bool is_within_hyperbolic(const Shares &shares) {
  if (shares.product().high <= 2 * kOne) return true;
  if (shares.product().low > 2 * kOne) return false;
  Natural above(1);
  Natural below(2);
  for (const Share &share : shares.all()) {
    const auto period = static_cast<Uint128>(share.period);
    const Uint128 divisor = gcd(share.amount, period);
    above = above * Natural((share.amount + period) / divisor);
    below = below * Natural(period / divisor);
    if (below.bits() > kMostBits) return false;
  }
  return above.is_at_most(below);
}

bool is_smaller(const Share &a, const Share &b) {
  const Natural left = Natural(a.amount) * Natural(static_cast<Uint128>(b.period));
  return !(Natural(b.amount) * Natural(static_cast<Uint128>(a.period))).is_at_most(left);
}

}  // namespace redag::analysis
