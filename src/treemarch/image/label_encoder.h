/// \file
/// From label values to materials.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Values as materials, see LabelImage.
struct EncodedLabels {
  CompactArray voxels;
  std::vector<std::int32_t> labels;  ///< by first appearance
  std::int64_t changes = 0;          ///< voxels that differ from the one before them, in scan order
};

/// Numbers values by their first appearance, in parallel; the same for any number of threads, and however the values
/// are divided into stretches. Needs the memory of the materials, not of the values.
class LabelEncoder {
 public:
  /// \param size number of values to come. \param execution outlives the object
  LabelEncoder(std::int64_t size, const Execution& execution) : size_(size), execution_(execution) {}

  /// The next values. T is an integer type of 8 to 64 bits. \pre every value fits 32 bits with sign
  template <class T>
  void add(std::span<const T> values);
  /// All that was added.
  [[nodiscard]] EncodedLabels take() { return std::move(result_); }

 private:
  void add_labels(const std::vector<std::int32_t>& distinct);
  void make_room(std::int64_t more);

  std::int64_t size_;
  const Execution& execution_;
  EncodedLabels result_;
  std::vector<std::pair<std::int32_t, MaterialId>> known_;  // label and material, ascending
  std::int32_t last_ = 0;                                   // label
};

}  // namespace treemarch
