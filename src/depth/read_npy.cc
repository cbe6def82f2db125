#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>
#include <sstream>

#include "cairn/base/error.h"
#include "depth/raw_map.h"

// NumPy's format: https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

struct NpyHeader {
  std::string type;  // "<f4", ...
  bool fortran_order = false;
  std::vector<long long> shape;
  size_t data_begin = 0;
};

// The text after `'key':` in the header's Python dictionary, up to the value's end.
std::optional<std::string> DictionaryValue(const std::string& text, const std::string& key) {
  const size_t at = text.find("'" + key + "'");
  if (at == std::string::npos) return std::nullopt;
  const size_t colon = text.find(':', at);
  if (colon == std::string::npos) return std::nullopt;
  const size_t begin = text.find_first_not_of(' ', colon + 1);
  if (begin == std::string::npos) return std::nullopt;
  const size_t end = text[begin] == '(' ? text.find(')', begin) : text.find_first_of(",}", begin);
  if (end == std::string::npos) return std::nullopt;
  return text.substr(begin, end - begin);
}

NpyHeader ParseHeader(const std::string& path, const std::string& bytes) {
  if (bytes.size() < 10 || std::memcmp(bytes.data(), "\x93NUMPY", 6) != 0) {
    throw IoError(path, "not a .npy file");
  }
  size_t length = 0, begin = 0;
  if (bytes[6] == 1) {
    uint16_t value;
    std::memcpy(&value, bytes.data() + 8, sizeof(value));
    length = value;
    begin = 10;
  } else if (bytes.size() >= 12) {
    uint32_t value;
    std::memcpy(&value, bytes.data() + 8, sizeof(value));
    length = value;
    begin = 12;
  }
  if (begin == 0 || begin + length > bytes.size()) throw IoError(path, "truncated .npy header");
  const std::string text = bytes.substr(begin, length);
  const auto type = DictionaryValue(text, "descr");
  const auto order = DictionaryValue(text, "fortran_order");
  const auto shape = DictionaryValue(text, "shape");
  if (!type || !order || !shape || !shape->starts_with('('))
    throw IoError(path, "incomplete .npy header");

  NpyHeader header;
  header.data_begin = begin + length;
  header.fortran_order = order->find("True") != std::string::npos;
  header.type = type->size() > 2 ? type->substr(1, type->size() - 2) : "";
  std::istringstream stream(shape->substr(1));
  for (std::string number; std::getline(stream, number, ',');) {
    std::istringstream parser(number);
    long long value;
    if (parser >> value) header.shape.push_back(value);
  }
  return header;
}

template <class T>
void Copy(const char* data, std::vector<float>* values) {
  for (size_t i = 0; i < values->size(); ++i) {
    T value;
    std::memcpy(&value, data + i * sizeof(T), sizeof(T));
    (*values)[i] = static_cast<float>(value);
  }
}

size_t TypeSize(const std::string& type) {
  if (type == "|u1") return 1;
  if (type == "<f2" || type == "<u2") return 2;
  if (type == "<f4") return 4;
  if (type == "<f8") return 8;
  return 0;
}

// Of values column by column, as NumPy writes what was transposed.
std::vector<float> ByRows(const std::vector<float>& columns, int width, int height) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  std::vector<float> rows(columns.size());
  Rows::Map(rows.data(), height, width) = Eigen::MatrixXf::Map(columns.data(), height, width);
  return rows;
}

}  // namespace

RawMap ParseNpy(const std::string& path, const std::string& bytes) {
  NpyHeader header = ParseHeader(path, bytes);
  const size_t type_size = TypeSize(header.type);
  if (type_size == 0) {
    throw IoError(path, "values of type '" + header.type + "'; float16/32/64, uint8/16 are read");
  }
  while (header.shape.size() > 2 && header.shape.front() == 1) {
    header.shape.erase(header.shape.begin());
  }
  if (header.shape.size() != 2) throw IoError(path, "the shape is not H x W or 1 x H x W");
  CheckMapSize(path, header.shape[1], header.shape[0], type_size, bytes.size() - header.data_begin);

  RawMap map;
  map.width = static_cast<int>(header.shape[1]);
  map.height = static_cast<int>(header.shape[0]);
  map.values.resize(static_cast<size_t>(map.width) * map.height);
  const char* data = bytes.data() + header.data_begin;
  if (header.type == "|u1") Copy<uint8_t>(data, &map.values);
  if (header.type == "<u2") Copy<uint16_t>(data, &map.values);
  if (header.type == "<f2") Copy<Eigen::half>(data, &map.values);
  if (header.type == "<f4") Copy<float>(data, &map.values);
  if (header.type == "<f8") Copy<double>(data, &map.values);
  if (header.fortran_order) map.values = ByRows(map.values, map.width, map.height);
  return map;
}

}  // namespace cairn
