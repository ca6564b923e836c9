#include "daemon/observer/observer.h"
