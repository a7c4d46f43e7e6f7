// What the device benchmarks share: timing on both sides, and rows of JSON.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "trajopt/cuda/base/stream.h"

namespace trajopt::bench {

struct Timing {
  double best_ms = 0.0, median_ms = 0.0;
  int repetitions = 0;
};

inline Timing summarize(std::vector<double> ms) {
  std::sort(ms.begin(), ms.end());
  return {ms.front(), ms[ms.size() / 2], static_cast<int>(ms.size())};
}

// Repeats `once`, which returns its milliseconds, for about `seconds` and at least three times,
// after one run that is not counted.
inline Timing repeat(double seconds, const std::function<double()>& once) {
  once();
  std::vector<double> ms;
  double total = 0.0;
  while (ms.size() < 3 || (total < 1e3 * seconds && ms.size() < 1000)) {
    ms.push_back(once());
    total += ms.back();
  }
  return summarize(std::move(ms));
}

inline Timing time_cpu(double seconds, const std::function<void()>& work) {
  return repeat(seconds, [&] {
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
        .count();
  });
}

// Time on the device between two events around the work that `enqueue` puts into the stream.
inline Timing time_gpu(double seconds, const cuda::Stream& stream,
                       const std::function<void()>& enqueue) {
  const cuda::Event begin, end;
  return repeat(seconds, [&] {
    begin.record(stream);
    enqueue();
    end.record(stream);
    end.synchronize();
    return cuda::elapsed_ms(begin, end);
  });
}

// One line of JSON, field by field.
class Row {
 public:
  Row& text(const char* name, const std::string& value) {
    std::string quoted(1, '"');
    for (char c : value) {
      if (c == '"' || c == '\\') quoted += '\\';
      quoted += c == '\n' ? ' ' : c;
    }
    quoted += '"';
    return raw(name, quoted);
  }
  Row& number(const char* name, double value) {
    if (!std::isfinite(value)) return raw(name, "null");
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.6g", value);
    return raw(name, digits);
  }
  Row& flag(const char* name, bool value) { return raw(name, value ? "true" : "false"); }
  Row& timing(const std::string& name, const Timing& t) {
    return number((name + "_ms").c_str(), t.best_ms)
        .number((name + "_median_ms").c_str(), t.median_ms);
  }
  void print(std::FILE* to) const {
    std::fprintf(to, "{%s}\n", fields_.c_str());
    std::fflush(to);
  }

 private:
  Row& raw(const char* name, const std::string& value) {
    if (!fields_.empty()) fields_ += ", ";
    fields_ += '"';
    fields_ += name;
    fields_ += "\": ";
    fields_ += value;
    return *this;
  }
  std::string fields_;
};

}  // namespace trajopt::bench
