// Arrays on their way to a device: what travels once, and that measuring and filling agree.
#include "trajopt/solver/parcel.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <vector>

namespace trajopt {
namespace {

struct Term {  // with bytes between its members
  int kind;
  double weight;
  const double* target;
};

// In memory where something lay before.
Term make_term(int before, int kind, double weight, const double* target) {
  Term term;
  std::memset(static_cast<void*>(&term), before, sizeof term);
  term.kind = kind;
  term.weight = weight;
  term.target = target;
  return term;
}

class Filled {
 public:
  explicit Filled(const std::function<void(Parcel&)>& fill) {
    fill(parcel_);
    measured_ = parcel_.size();
    memory_.resize(measured_);
    parcel_.address(memory_.data());
    fill(parcel_);
    if (parcel_.size() == measured_) std::memcpy(memory_.data(), parcel_.data(), measured_);
  }
  std::size_t measured() const { return measured_; }
  std::size_t size() const { return parcel_.size(); }

 private:
  Parcel parcel_;
  std::size_t measured_ = 0;
  std::vector<std::byte> memory_;
};

TEST(Parcel, WhatIsTheSameTravelsOnce) {
  const std::vector<double> a = {1, 2, 3}, same = a, other = {1, 2, 4};
  const double *first = nullptr, *second = nullptr, *third = nullptr;
  const Filled filled([&](Parcel& p) {
    first = p.add(a.data(), a.size());
    second = p.add(same.data(), same.size());
    third = p.add(other.data(), other.size());
  });
  EXPECT_EQ(first, second);
  EXPECT_NE(first, third);
  EXPECT_EQ(std::vector<double>(first, first + 3), a);
  EXPECT_EQ(std::vector<double>(third, third + 3), other);
}

TEST(Parcel, BytesBetweenMembersDoNotChangeItsSize) {
  const double target = 7;
  for (bool same_at_first : {true, false}) {
    int pass = 0;
    const Term* terms[2];
    const Filled filled([&](Parcel& p) {
      const bool same = (pass++ == 0) == same_at_first;
      for (int k = 0; k < 2; ++k) {
        const Term term = make_term(same ? 0 : k, 3, 0.5, p.add(&target, 1));
        terms[k] = p.add(&term, 1);
      }
    });
    ASSERT_EQ(filled.size(), filled.measured());
    for (const Term* term : terms) {
      EXPECT_EQ(term->kind, 3);
      EXPECT_EQ(term->weight, 0.5);
      EXPECT_EQ(*term->target, target);
    }
  }
}

// The first of all arrays lies at the beginning, which is not the same as nowhere.
TEST(Parcel, NothingIsNotWhatLiesAtTheBeginning) {
  const double target = 7;
  const Term* terms[2];
  const Filled filled([&](Parcel& p) {
    const Term with = make_term(0, 3, 0.5, p.add(&target, 1));
    const Term without = make_term(0, 3, 0.5, p.add<double>(nullptr, 1));
    terms[0] = p.add(&with, 1);
    terms[1] = p.add(&without, 1);
  });
  ASSERT_EQ(filled.size(), filled.measured());
  EXPECT_EQ(*terms[0]->target, target);
  EXPECT_EQ(terms[1]->target, nullptr);
}

TEST(Parcel, ArraysWithoutValues) {
  const double value = 7;
  const double *none = nullptr, *one = nullptr;
  const Filled filled([&](Parcel& p) {
    for (int k = 0; k < 2; ++k) none = p.add(&value, 0);
    one = p.add(&value, 1);
  });
  EXPECT_NE(none, nullptr);
  EXPECT_EQ(*one, value);
}

}  // namespace
}  // namespace trajopt
