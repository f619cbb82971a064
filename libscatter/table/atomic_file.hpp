#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace scatter::table {

/// Writing whole files or none. Both classes are for the formats and pictures of the library.

/// A file that appears under its name only when it is complete. The constructor creates NAME.part-PID beside
/// the target, commit() makes it durable and renames it, the destructor removes it if commit() was not
/// reached. remove_unfinished_files() (files.hpp) knows every PartFile that is open. A killed process
/// (SIGKILL, power) leaves at most the part, never something under the final name.
class PartFile {
public:
  /// Throws InputError if the target is a folder, no regular file, or in a folder that does not exist;
  /// RunError if the folder may not be written or the disk refuses.
  explicit PartFile(const std::filesystem::path& target);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  /// As the user named it, for messages.
  [[nodiscard]] const std::filesystem::path& name() const { return name_; }
  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  /// Open for reading and writing; owned by this object.
  [[nodiscard]] int descriptor() const { return descriptor_; }

  /// fsync, rename, fsync of the folder. Throws RunError; the part is then removed by the destructor.
  void commit();

private:
  std::filesystem::path name_, target_, part_;
  int descriptor_ = -1;
  int slot_ = -1;
};

/// Buffered writing to a file descriptor that reports every failure, unlike iostreams and OpenEXR's own.
class FileWriter {
public:
  /// name is for messages. Neither takes the descriptor over nor closes it.
  FileWriter(int descriptor, std::string name) : descriptor_(descriptor), name_(std::move(name)) {}

  /// All throw RunError, once the disk fails and ever after.
  void write(std::string_view bytes);
  void seek(std::size_t position);
  void flush();
  [[nodiscard]] std::size_t position() const { return flushed_ + buffer_.size(); }
  /// True after any failure: what was written is worth nothing.
  [[nodiscard]] bool failed() const { return error_ != 0; }
  [[nodiscard]] int error() const { return error_; } ///< errno's value of the failure

private:
  int descriptor_;
  std::string name_;
  std::vector<char> buffer_;
  std::size_t flushed_ = 0;
  int error_ = 0;
};

/// Bytes that can still be written to the disk that holds the folder of `path`.
[[nodiscard]] double free_disk_bytes(const std::filesystem::path& path);

/// "cannot write NAME: REASON", with the reason from errno's value `error` and, when the disk is full, its
/// free space.
[[nodiscard]] std::string disk_error(const std::filesystem::path& name, int error);

/// 6.8e9 -> "6.8 GB".
[[nodiscard]] std::string bytes_in_words(double bytes);

} // namespace scatter::table
