/* Prints how many bytes an instance takes, its model in it. */

#include <stdio.h>

#include "instance.h"

int main(void) {
    printf("%lu\n", (unsigned long)sizeof(Instance));
    return 0;
}
