/// \file
/// The elements of a DICOM file, found without trusting a single length in it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace treemarch {

/// The data elements of the outermost level up to the pixel data, in file order.
struct DicomElements {
  struct Element {
    std::uint32_t tag = 0;   ///< group << 16 | element
    std::size_t offset = 0;  ///< of the value in `bytes`
    std::size_t length = 0;  ///< of the value; 0 for sequences and encapsulated pixels of undefined length
  };
  std::string bytes;  ///< the whole file
  std::vector<Element> elements;
  bool big_endian = false;
  bool compressed = false;  ///< the pixels are encapsulated

  [[nodiscard]] const Element* find(std::uint32_t tag) const;
  /// A value as text without padding, empty where the element is absent.
  [[nodiscard]] std::string text(std::uint32_t tag) const;
  /// An unsigned short.
  [[nodiscard]] std::optional<unsigned> number(std::uint32_t tag) const;
  /// Decimal strings; empty where the element is absent or malformed.
  [[nodiscard]] std::vector<double> decimals(std::uint32_t tag) const;
};

/// Reads a file and finds its elements. \throw Error(input) where a length leads beyond the end of the file
DicomElements read_dicom_elements(const std::string& path);

}  // namespace treemarch
