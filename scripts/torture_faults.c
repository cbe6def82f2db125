/* For LD_PRELOAD by scripts/torture: lets system calls on files of one folder fail.
   TORTURE_FOLDER: prefix of the files' paths; TORTURE_CALL: name of the call; TORTURE_AT: which one,
   from 1; TORTURE_ERRNO: its error, 0: half of what was asked for is written or read;
   TORTURE_STAYS: set, all later calls fail, too, as with a full disk. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static atomic_int num_calls;

static int IsInFolder(const char* path) {
  const char* folder = getenv("TORTURE_FOLDER");
  return folder && path && strncmp(path, folder, strlen(folder)) == 0;
}

static int IsOfFolder(int descriptor) {
  char link[64], path[4096];
  snprintf(link, sizeof(link), "/proc/self/fd/%d", descriptor);
  const ssize_t size = readlink(link, path, sizeof(path) - 1);
  if (size <= 0) return 0;
  path[size] = 0;
  return IsInFolder(path);
}

/* Is it this call's turn? `*error` is then what it fails with. */
static int Fails(const char* call, int* error) {
  const char* wanted = getenv("TORTURE_CALL");
  if (!wanted || strcmp(wanted, call) != 0) return 0;
  const int at = atoi(getenv("TORTURE_AT"));
  const int number = atomic_fetch_add(&num_calls, 1) + 1;
  if (number != at && !(number > at && getenv("TORTURE_STAYS"))) return 0;
  *error = atoi(getenv("TORTURE_ERRNO"));
  return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* A call that moves `count` bytes. */
#define MOVING(name, data_type, parameters, arguments, half_arguments)  \
  ssize_t name parameters {                                             \
    int error = 0;                                                      \
    if (IsOfFolder(fd) && Fails(#name, &error)) {                       \
      if (error == 0 && count > 1) return REAL(name) half_arguments;    \
      if (error == 0) return REAL(name) arguments;                      \
      errno = error;                                                    \
      return -1;                                                        \
    }                                                                   \
    return REAL(name) arguments;                                        \
  }
MOVING(write, const void*, (int fd, const void* data, size_t count), (fd, data, count),
       (fd, data, count / 2))
MOVING(read, void*, (int fd, void* data, size_t count), (fd, data, count), (fd, data, count / 2))
MOVING(pwrite64, const void*, (int fd, const void* data, size_t count, off64_t at),
       (fd, data, count, at), (fd, data, count / 2, at))
MOVING(pread64, void*, (int fd, void* data, size_t count, off64_t at), (fd, data, count, at),
       (fd, data, count / 2, at))

#define SIMPLE(name, parameters, arguments, is_ours)                \
  int name parameters {                                             \
    int error = 0;                                                  \
    if (is_ours && Fails(#name, &error)) {                          \
      errno = error ? error : EIO;                                  \
      return -1;                                                    \
    }                                                               \
    return REAL(name) arguments;                                    \
  }
SIMPLE(fsync, (int fd), (fd), IsOfFolder(fd))
SIMPLE(fdatasync, (int fd), (fd), IsOfFolder(fd))
SIMPLE(ftruncate64, (int fd, off64_t size), (fd, size), IsOfFolder(fd))
SIMPLE(rename, (const char* from, const char* to), (from, to), IsInFolder(to))
SIMPLE(unlink, (const char* path), (path), IsInFolder(path))
SIMPLE(mkdir, (const char* path, mode_t mode), (path, mode), IsInFolder(path))

static mode_t ModeOf(int flags, va_list list) {
  return flags & (O_CREAT | O_TMPFILE) ? va_arg(list, mode_t) : 0;
}
#define OPENING(name)                                      \
  int name(const char* path, int flags, ...) {             \
    va_list list;                                          \
    va_start(list, flags);                                 \
    const mode_t mode = ModeOf(flags, list);               \
    va_end(list);                                          \
    int error = 0;                                         \
    if (IsInFolder(path) && Fails("open", &error)) {       \
      errno = error ? error : EIO;                         \
      return -1;                                           \
    }                                                      \
    return REAL(name)(path, flags, mode);                  \
  }
OPENING(open)
OPENING(open64)

/* The calls of stdio do not come by here, but its functions do. */
FILE* fopen64(const char* path, const char* mode) {
  int error = 0;
  if (IsInFolder(path) && Fails("fopen", &error)) {
    errno = error ? error : EIO;
    return NULL;
  }
  return REAL(fopen64)(path, mode);
}
size_t fwrite(const void* data, size_t size, size_t count, FILE* file) {
  int error = 0;
  if (IsOfFolder(fileno(file)) && Fails("fwrite", &error)) {
    errno = error ? error : ENOSPC;
    return 0;
  }
  return REAL(fwrite)(data, size, count, file);
}
int fflush(FILE* file) {
  int error = 0;
  if (file && IsOfFolder(fileno(file)) && Fails("fflush", &error)) {
    errno = error ? error : ENOSPC;
    return EOF;
  }
  return REAL(fflush)(file);
}
