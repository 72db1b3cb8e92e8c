/// \file
/// Objects of the HDF5 library that are closed when they go out of scope.
#pragma once

#include <hdf5.h>

#include <string>
#include <utility>

namespace treemarch {

/// An identifier that was opened, with the function that closes it.
class Hdf5Handle {
 public:
  Hdf5Handle() = default;
  Hdf5Handle(hid_t id, herr_t (*closer)(hid_t)) : id_(id), close_(closer) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept
      : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(std::exchange(other.close_, nullptr)) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  Hdf5Handle(const Hdf5Handle&) = delete;
  Hdf5Handle& operator=(const Hdf5Handle&) = delete;
  ~Hdf5Handle() { close(); }

  /// Closes it now and says whether that went well; closing a file writes what is still in memory.
  bool close() { return id_ < 0 || close_ == nullptr || close_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }
  [[nodiscard]] bool is_open() const { return id_ >= 0; }
  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): every call of the library takes one

 private:
  hid_t id_ = H5I_INVALID_HID;
  herr_t (*close_)(hid_t) = nullptr;
};

/// Keeps the library from printing its errors while the object lives: failures are found by what calls return.
class Hdf5Quiet {
 public:
  Hdf5Quiet() {
    H5dont_atexit();  // it crashes over a file that could not be written because the disk was full
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Hdf5Quiet() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  Hdf5Quiet(const Hdf5Quiet&) = delete;
  Hdf5Quiet& operator=(const Hdf5Quiet&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

}  // namespace treemarch
