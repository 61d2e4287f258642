// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/effects.hpp"

#include <gtest/gtest.h>

namespace redag::experiment {
namespace {

template <class Result>
std::vector<EffectCell> cells(std::uint32_t a, std::uint32_t b, std::uint32_t c, Result result) {
  std::vector<EffectCell> all;
  for (std::uint32_t i = 0; i < a; ++i) {
    for (std::uint32_t j = 0; j < b; ++j) {
      for (std::uint32_t k = 0; k < c; ++k) all.push_back({{i, j, k}, result(i, j, k)});
    }
  }
  return all;
}

TEST(Effects, OneFactorExplainsEverything) {
  const Effects effects = effects_of({3, 2, 2}, cells(3, 2, 2, [](double i, double, double) {
                                       return std::vector<double>{i, i};
                                     }));
  EXPECT_DOUBLE_EQ(effects.mean, 1);
  EXPECT_DOUBLE_EQ(effects.terms[0].share, 1);
  for (std::size_t t = 1; t < effects.terms.size(); ++t) EXPECT_NEAR(effects.terms[t].share, 0, 1e-12);
  EXPECT_EQ(effects.levels[0], (std::vector<double>{0, 1, 2}));
  EXPECT_NEAR(effects.noise + effects.higher, 0, 1e-12);
}

TEST(Effects, AnInteractionIsNotAMainEffect) {
  // The result is the exclusive or of the first two factors; neither explains anything alone.
  const Effects effects = effects_of({2, 2, 3}, cells(2, 2, 3, [](std::uint32_t i, std::uint32_t j, std::uint32_t) {
                                       return std::vector<double>{static_cast<double>(i != j)};
                                     }));
  EXPECT_NEAR(effects.terms[0].share, 0, 1e-12);
  EXPECT_NEAR(effects.terms[1].share, 0, 1e-12);
  EXPECT_EQ(effects.terms[3].factors, (std::vector<std::size_t>{0, 1}));
  EXPECT_NEAR(effects.terms[3].share, 1, 1e-12);
}

TEST(Effects, SharesAddUp) {
  const Effects effects = effects_of({2, 2, 2}, cells(2, 2, 2, [](double i, double j, double k) {
                                       const double r = i + 2 * j * k + 3 * i * j * k;
                                       return std::vector<double>{r - 0.5, r, r + 0.5};
                                     }));
  double sum = effects.higher + effects.noise;
  for (const Effects::Term &term : effects.terms) sum += term.share;
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_GT(effects.higher, 0.01);
  EXPECT_NEAR(effects.noise * effects.variance, 0.5 / 3, 1e-12);
}

TEST(Effects, NothingVaries) {
  const Effects effects =
      effects_of({2, 1, 1}, cells(2, 1, 1, [](double, double, double) { return std::vector<double>{0.25}; }));
  EXPECT_EQ(effects.variance, 0);
  EXPECT_EQ(effects.terms[0].share, 0);
}

}  // namespace
}  // namespace redag::experiment
