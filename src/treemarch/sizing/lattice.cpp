#include "treemarch/sizing/lattice.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

[[noreturn]] void bad_pattern(std::string_view text) {
  throw Error(ErrorKind::usage, "--pattern: '" + std::string(text) +
                                    "' is no pattern; give 'auto', or factors from 1 to 64 such as '2', '2x2x1' or "
                                    "'3,2' (coarse to fine)");
}

/// Calls use(part) for the parts of a text between separators.
template <class Use>
void split(std::string_view text, char separator, Use&& use) {
  while (true) {
    const std::size_t end = text.find(separator);
    use(text.substr(0, end));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

template <int Dim>
double longest(const Vec<Dim>& sides) {
  return *std::max_element(sides.begin(), sides.end());
}

template <int Dim>
double aspect(const Vec<Dim>& sides) {
  return longest(sides) / *std::min_element(sides.begin(), sides.end());
}

std::string text_of(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.4g", value);
  return buffer;
}

template <int Dim>
std::string text_of(const Vec<Dim>& sides) {
  std::string text = text_of(sides[0]);
  for (int d = 1; d < Dim; ++d) text += " x " + text_of(sides[d]);
  return text;
}

void check_sizes(const SizingRule& rule) {
  const auto check = [&](double size, const char* option) {
    if (!std::isfinite(size) || size < 0)
      throw Error(ErrorKind::usage,
                  std::string(option) + ": " + text_of(size) + " is no size; give a length greater than 0");
    if (rule.max_size > 0 && size > rule.max_size * kSizeTolerance)
      throw Error(ErrorKind::usage, std::string(option) + ": " + text_of(size) + " is above the largest size " +
                                        text_of(rule.max_size) + "; choose a smaller one or a larger --max-size");
  };
  check(rule.max_size, "--max-size");
  check(rule.min_size, "--min-size");
  for (const double size : rule.material_size) check(size, "--size");
  for (const double size : rule.material_interface_size) check(size, "--interface");
  for (const SizingRule::Interface& i : rule.interface_size) check(i.size, "--interface");
}

/// Voxels per axis of the smallest cell when cells are whole voxels.
template <int Dim>
Coord<Dim> whole_voxels(const Vec<Dim>& spacing, const Coord<Dim>& extent, double size) {
  Coord<Dim> n{};
  for (int d = 0; d < Dim; ++d)
    n[d] = std::max<std::int32_t>(
        1, static_cast<std::int32_t>(std::min<double>(extent[d], size / spacing[d] * kSizeTolerance)));
  return n;
}

/// Voxels per axis of the smallest cell with an aspect ratio below 2. Where the size is shorter than the longest
/// spacing, each side is as near as it can be (on the scale of ratios) to a common one, so that no two differ by 2.
template <int Dim>
Coord<Dim> isotropic_voxels(const Vec<Dim>& spacing, const Coord<Dim>& extent, double size) {
  if (size * kSizeTolerance >= longest(spacing)) return whole_voxels(spacing, extent, size);
  const double target = std::max(size, longest(spacing) / 1.4);
  Coord<Dim> n{};
  for (int d = 0; d < Dim; ++d) {
    const double exact = target / spacing[d];
    const double low = std::max(1.0, std::floor(exact));
    n[d] = static_cast<std::int32_t>(exact * exact > low * (low + 1) ? low + 1 : low);
    n[d] = std::min(n[d], extent[d]);
  }
  return n;
}

/// The factors of the next coarser level by the automatic pattern.
template <int Dim>
Coord<Dim> automatic_factors(const Vec<Dim>& sides) {
  Coord<Dim> all{};
  all.fill(2);
  Coord<Dim> some = all;
  Vec<Dim> next = sides;
  for (int d = 0; d < Dim; ++d) {
    if (sides[d] * std::sqrt(2.0) > longest(sides)) some[d] = 1;
    next[d] *= some[d];
  }
  return aspect(next) < 0.9 * aspect(sides) ? some : all;
}

/// Levels above the smallest cell, coarse to fine.
template <int Dim>
std::vector<Coord<Dim>> levels_above(const SizedLattice<Dim>& fine, const std::vector<Coord<Dim>>& factors,
                                     double max_size) {
  if (factors.size() > 1) return factors;
  std::vector<Coord<Dim>> levels;
  Vec<Dim> sides = fine.lattice.unit;
  Coord<Dim> cells = fine.lattice.extent;  // whole cells of the level that fit into the box
  while (true) {
    const Coord<Dim> step = factors.empty() ? automatic_factors(sides) : factors[0];
    bool fits = true;
    for (int d = 0; d < Dim; ++d) {
      sides[d] *= step[d];
      cells[d] /= step[d];
      fits = fits && cells[d] > 0;
    }
    if (!fits || longest(sides) > max_size * kSizeTolerance) break;
    levels.push_back(step);
  }
  std::reverse(levels.begin(), levels.end());
  return levels;
}

/// Splits each of some numbers into its prime factors, one of each number a level.
template <int Dim>
std::vector<Coord<Dim>> prime_levels(Coord<Dim> numbers) {
  std::vector<Coord<Dim>> levels;
  while (product(numbers) > 1) {
    Coord<Dim> level{};
    for (int d = 0; d < Dim; ++d) {
      std::int32_t prime = numbers[d] > 1 ? 2 : 1;
      while (prime > 1 && numbers[d] % prime != 0) ++prime;
      level[d] = prime;
      numbers[d] /= prime;
    }
    levels.push_back(level);
  }
  return levels;
}

template <int Dim>
void warn_about_size(double asked, const Vec<Dim>& sides, const Execution& execution) {
  for (const double s : sides)
    if (std::abs(s - asked) > 1e-6 * asked) {
      execution.warn("the smallest size " + text_of(asked) + " becomes cells of " + text_of(sides) +
                     ", the nearest that this method can fit to the voxels");
      return;
    }
}

}  // namespace

template <int Dim>
std::vector<Coord<Dim>> parse_pattern(std::string_view text) {
  std::vector<Coord<Dim>> factors;
  if (text == "auto") return factors;
  split(text, ',', [&](std::string_view entry) {
    Coord<Dim> level{};
    int n = 0;
    split(entry, 'x', [&](std::string_view number) {
      int value = 0;
      const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
      if (error != std::errc() || end != number.data() + number.size() || value < 1 || value > 64 || n == Dim)
        bad_pattern(text);
      level[n++] = value;
    });
    if (n == 1) level.fill(level[0]);
    if ((n != 1 && n != Dim) || product(level) == 1) bad_pattern(text);
    factors.push_back(level);
  });
  return factors;
}

template <int Dim>
SizedLattice<Dim> choose_lattice(const LabelImage<Dim>& image, const std::vector<Coord<Dim>>& factors,
                                 const SizingRule& rule, const Execution& execution) {
  check_sizes(rule);
  if (*std::max_element(image.extent.begin(), image.extent.end()) > kMostCellsAlongAxis)
    throw Error(ErrorKind::limits, "image: more than 2^29 voxels along an axis; crop it");
  const Vec<Dim>& spacing = image.frame.spacing;
  const double size = smallest_size(rule, *std::min_element(spacing.begin(), spacing.end()));
  const bool stretched = factors.empty() && aspect(spacing) >= 2;
  const Coord<Dim> voxels =
      stretched ? isotropic_voxels(spacing, image.extent, size) : whole_voxels(spacing, image.extent, size);

  SizedLattice<Dim> result;
  Coord<Dim> remainder{};  // parts per axis into which the smallest cell must be divisible to fill the box
  for (int d = 0; d < Dim; ++d) {
    remainder[d] = 1;
    if (stretched) {
      result.lattice.extent[d] =
          static_cast<std::int32_t>(std::max<long>(1, std::lround(static_cast<double>(image.extent[d]) / voxels[d])));
      result.lattice.unit[d] = image.extent[d] * spacing[d] / result.lattice.extent[d];
    } else {
      remainder[d] = voxels[d] / std::gcd(voxels[d], image.extent[d]);
      result.lattice.extent[d] = image.extent[d] / voxels[d];
      result.lattice.unit[d] = voxels[d] * spacing[d];
    }
  }
  if (rule.min_size > 0) warn_about_size(size, result.lattice.unit, execution);

  const double max_size = rule.max_size > 0 ? rule.max_size : kDefaultCoarsening * longest(result.lattice.unit);
  result.pattern.factors = levels_above(result, factors, max_size);
  result.deepest_level = result.pattern.finest_level();
  for (const Coord<Dim>& level : prime_levels(remainder)) result.pattern.factors.push_back(level);
  if (!stretched) {
    for (int d = 0; d < Dim; ++d) {
      const std::int32_t unit = voxels[d] / remainder[d];
      result.lattice.extent[d] = image.extent[d] / unit;
      result.lattice.unit[d] = unit * spacing[d];
    }
  }
  for (int d = 0; d < Dim; ++d) {
    double root = 1;
    for (const Coord<Dim>& level : result.pattern.factors) root *= level[d];
    if (root > 1 << 30)
      throw Error(ErrorKind::usage, "--pattern: its roots would be larger than 2^30 voxels; give fewer levels");
  }
  return result;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                     \
  template std::vector<Coord<DIM>> parse_pattern<DIM>(std::string_view);                                               \
  template SizedLattice<DIM> choose_lattice(const LabelImage<DIM>&, const std::vector<Coord<DIM>>&, const SizingRule&, \
                                            const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
