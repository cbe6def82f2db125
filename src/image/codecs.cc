#include "image/codecs.h"

#include <dlfcn.h>
#include <jpeglib.h>
#include <png.h>

#include <csetjmp>
#include <filesystem>

#include "cairn/base/error.h"

namespace cairn {
namespace {

// libjpeg's way of reporting: a jump out of the decoder.
struct JpegError {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
};

void JumpOut(j_common_ptr info) {
  auto* error = reinterpret_cast<JpegError*>(info->err);
  error->manager.format_message(info, error->message);
  std::longjmp(error->jump, 1);
}

void Ignore(j_common_ptr, int) {}  // warnings: the decoder goes on

enum class JpegOutcome { kDecoded, kOtherColors, kFailed };

// No object with a destructor may live here, since errors jump out.
JpegOutcome RunJpegDecoder(std::string_view bytes, bool is_gray, JpegError* error, Bitmap* bitmap) {
  jpeg_decompress_struct info;
  info.err = jpeg_std_error(&error->manager);
  error->manager.error_exit = JumpOut;
  error->manager.emit_message = Ignore;
  if (setjmp(error->jump) != 0) {
    jpeg_destroy_decompress(&info);
    return JpegOutcome::kFailed;
  }
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&info, TRUE);
  if (info.num_components != 1 && info.num_components != 3) {
    jpeg_destroy_decompress(&info);
    return JpegOutcome::kOtherColors;
  }
  info.out_color_space = is_gray ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_start_decompress(&info);
  bitmap->width = static_cast<int>(info.output_width);
  bitmap->height = static_cast<int>(info.output_height);
  bitmap->channels = is_gray ? 1 : 3;
  const size_t row_size = static_cast<size_t>(bitmap->width) * bitmap->channels;
  bitmap->data.resize(row_size * bitmap->height);
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = bitmap->data.data() + row_size * info.output_scanline;
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
  return JpegOutcome::kDecoded;
}

// The plugin, beside the running program (PREFIX/bin, with the plugin under PREFIX) or where it was
// built or installed.
void* LoadPlugin() {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path prefix = fs::read_symlink("/proc/self/exe", ignored).parent_path().parent_path();
  for (const fs::path& path : {prefix / CAIRN_IMAGE_PLUGIN, fs::path(CAIRN_IMAGE_PLUGIN_BUILT),
                               fs::path(CAIRN_IMAGE_PLUGIN_INSTALLED)}) {
    if (!fs::exists(path, ignored)) continue;
    if (void* plugin = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL)) return plugin;
  }
  return nullptr;
}

template <class Function>
Function FindInPlugin(const std::string& path, const char* name) {
  static void* const plugin = LoadPlugin();
  if (plugin) {
    if (void* symbol = dlsym(plugin, name)) return reinterpret_cast<Function>(symbol);
  }
  throw IoError(
      path, std::string("the codecs for this format are missing: ") + CAIRN_IMAGE_PLUGIN_INSTALLED);
}

}  // namespace

bool DecodeJpeg(const std::string& path, std::string_view bytes, BitmapColor color,
                Bitmap* bitmap) {
  JpegError error;
  Bitmap decoded;
  switch (RunJpegDecoder(bytes, color == BitmapColor::kGray, &error, &decoded)) {
    case JpegOutcome::kDecoded:
      *bitmap = std::move(decoded);
      return true;
    case JpegOutcome::kOtherColors:
      return false;
    case JpegOutcome::kFailed:
      break;
  }
  throw IoError(path, std::string("cannot be decoded: ") + error.message);
}

bool DecodePng(std::string_view bytes, BitmapColor color, Bitmap* bitmap) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_memory(&image, bytes.data(), bytes.size())) return false;
  // Plain 8-bit files alone: OpenCV has its own way with transparency and 16 bits.
  const bool is_plain = (image.format & (PNG_FORMAT_FLAG_ALPHA | PNG_FORMAT_FLAG_LINEAR)) == 0;
  const bool has_colors = (image.format & PNG_FORMAT_FLAG_COLOR) != 0;
  const bool is_gray = color == BitmapColor::kGray;
  if (!is_plain || has_colors == is_gray) {
    png_image_free(&image);
    return false;
  }
  image.format = is_gray ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
  Bitmap decoded;
  decoded.width = static_cast<int>(image.width);
  decoded.height = static_cast<int>(image.height);
  decoded.channels = is_gray ? 1 : 3;
  decoded.data.resize(PNG_IMAGE_SIZE(image));
  if (!png_image_finish_read(&image, nullptr, decoded.data.data(), 0, nullptr)) return false;
  *bitmap = std::move(decoded);
  return true;
}

Bitmap DecodeByOpenCv(const std::string& path, const std::string& bytes, BitmapColor color) {
  const auto decode = FindInPlugin<DecodeFunction>(path, "CairnDecodeImage");
  Bitmap bitmap;
  std::string error;
  if (!decode(bytes, color == BitmapColor::kGray, &bitmap, &error)) throw IoError(path, error);
  return bitmap;
}

std::vector<uint8_t> EncodeByOpenCv(const std::string& path, const std::string& extension,
                                    const Bitmap& bitmap, int jpeg_quality) {
  const auto encode = FindInPlugin<EncodeFunction>(path, "CairnEncodeImage");
  std::vector<uint8_t> bytes;
  std::string error;
  if (!encode(extension, bitmap, jpeg_quality, &bytes, &error)) throw IoError(path, error);
  return bytes;
}

}  // namespace cairn
